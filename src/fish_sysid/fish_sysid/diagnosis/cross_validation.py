# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a fit gains on trials that it was not fitted to, its parameters as unsure as the other trials leave them.

log p(unseen | fitted) = log p(unseen, fitted) - log p(fitted), each by Laplace's approximation; the difference of two fits is
a partial Bayes factor (O'Hagan 1995, J. R. Stat. Soc. B 57). A prediction with the fitted values alone would reject a flow
for ground that only the unseen trials cross, where its fit leaves it open.

Near a fit the cost of a step d of the parameters is g'd + d'N d / 2, g and N from one pass of the filter over each trial.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Array
from fish_sysid.estimation.map_fit import Fit, climb, evaluate
from fish_sysid.estimation.thresholds import MOST_ITERATIONS, NEAR_GAIN, RIDGE


@dataclass(frozen=True)
class Quadratic:
    """Cost g'd + d'N d / 2 of a step d of all parameters (K,), the first `fitted` of them always free."""

    gradient: Array  # (K,)
    information: Array  # (K, K)
    fitted: int

    def best_step(self, chosen: Sequence[int]) -> Array:
        """The step (K,) of least cost that moves the fitted parameters and those `chosen`."""
        kept = [*range(self.fitted), *chosen]
        step = np.zeros(len(self.gradient))
        information = self.information[np.ix_(kept, kept)]
        ridged = information + RIDGE * np.diag(np.diag(information))
        step[kept] = -np.linalg.solve(ridged, self.gradient[kept])
        return step

    def cost(self, step: Array) -> float:
        """Nats that a step loses."""
        return float(self.gradient @ step + 0.5 * step @ self.information @ step)


def quadratic(gradients: Array, normals: Array, theta: Array, prior: Array) -> Quadratic:
    """The cost of some trials (M, K), (M, K, K) and of the prior of the fitted parameters theta."""
    gradient, information, fitted = gradients.sum(0), normals.sum(0), len(theta)
    gradient[:fitted] += theta / prior**2
    information[range(fitted), range(fitted)] += 1.0 / prior**2
    return Quadratic(gradient, information, fitted)


def on_all(fit: Fit, trials: Experiment) -> Fit:
    """A fit of some of these trials at the optimum of all, every measurement counted; its noise stays."""
    start = evaluate(fit.hypothesis, fit.theta, trials, fit.noise.ungated())
    return climb(start, trials, MOST_ITERATIONS, NEAR_GAIN)


def evidence_of(fit: Fit, trials: Sequence[int]) -> float:
    """Log evidence of some of the trials of a fit, less what is the same for any of them."""
    chosen, prior = list(trials), fit.hypothesis.parametrization.prior
    cost = quadratic(fit.result.gradient[chosen], fit.result.normal[chosen], fit.theta, prior)
    reached = fit.log_likelihood[chosen].sum() - 0.5 * np.sum((fit.theta / prior) ** 2)
    occam = 0.5 * np.linalg.slogdet(cost.information)[1]
    return float(reached - cost.cost(cost.best_step([])) - occam)


def predicted(fit: Fit, unseen: Sequence[int]) -> float:
    """log p(unseen | the other trials) of a fit to all."""
    everything = range(len(fit.log_likelihood))
    others = [i for i in everything if i not in unseen]
    return evidence_of(fit, everything) - evidence_of(fit, others)


def gain_unseen(base: Fit, fit: Fit, unseen: Sequence[int]) -> tuple[float, float]:
    """Nats by which one fit to all trials predicts some better than another, and the mean of that were it true.

    With r the whitened innovations of the fit, white if it is true, and r + d those of the base, each under its own noise, the
    gain sum((r + d)^2 - r^2) / 2 is sum(d^2) / 2 in the mean: much where the effect acts, little on trials that do not excite
    it. Where the two noises differ this is rough: the log determinants are left out, and d holds the change of scale.
    """
    apart = (fit.result.whitened - base.result.whitened)[:, list(unseen)]
    return predicted(fit, unseen) - predicted(base, unseen), 0.5 * float(np.nansum(apart**2))


def gain_left_out(base: Fit, fit: Fit) -> tuple[float, float]:
    """`gain_unseen` of every trial by the others, summed."""
    gains = [gain_unseen(base, fit, [i]) for i in range(len(fit.log_likelihood))]
    return sum(gain for gain, _ in gains), sum(expected for _, expected in gains)
