"""The cost of some trials near a fit: gradient and Gauss-Newton matrix, which one pass of the filter gives for each trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fish_sysid.estimation.ekf_types import Array

RIDGE = 1e-9  # of the diagonal: a rudder that stands still makes terms that nothing tells apart


@dataclass(frozen=True)
class Quadratic:
    """Cost g'd + d'N d / 2 of a step d of all parameters (K,), the first `fitted` of them always free."""

    gradient: Array  # (K,)
    normal: Array  # (K, K)
    fitted: int

    def best_step(self, chosen: Sequence[int]) -> Array:
        """The step (K,) of least cost that moves the fitted parameters and those `chosen`."""
        kept = [*range(self.fitted), *chosen]
        step = np.zeros(len(self.gradient))
        normal = self.normal[np.ix_(kept, kept)]
        step[kept] = -np.linalg.solve(
            normal + RIDGE * np.diag(np.diag(normal)), self.gradient[kept]
        )
        return step

    def cost(self, step: Array) -> float:
        """Nats that a step loses."""
        return float(self.gradient @ step + 0.5 * step @ self.normal @ step)


def quadratic(gradients: Array, normals: Array, theta: Array, prior: Array) -> Quadratic:
    """The cost of some trials (M, K), (M, K, K) and of the prior of the fitted parameters theta."""
    gradient, normal, fitted = gradients.sum(0), normals.sum(0), len(theta)
    gradient[:fitted] += theta / prior**2
    normal[range(fitted), range(fitted)] += 1.0 / prior**2
    return Quadratic(gradient, normal, fitted)
