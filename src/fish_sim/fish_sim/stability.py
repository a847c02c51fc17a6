# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Is a step fine enough? The fish's own modes about rest against a method's stability function."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.methods import Method
from fish_sim.model import DT, Layout, functions
from fish_sim.robot import Structure

Modes = NDArray[np.complex128]

MAX_SUBSTEPS = 256
GROWTH = 1e-6  # of an undamped mode per step that still counts as stable


def modes_at_rest(structure: Structure, parameters: NDArray[np.float64]) -> Modes:
    """Eigenvalues [1/s] of the motion linearised about rest with a straight tail; parameters (NP,)."""
    size = len(Layout(structure).motion)
    rest, still = np.zeros((size, size)), np.zeros((4, size))
    p = np.tile(np.reshape(parameters, (-1, 1)), size)
    _, jacobian = functions(structure).rate_jvp(
        rest, still, p, np.eye(size), still, np.zeros_like(p)
    )
    return np.linalg.eigvals(jacobian.full()).astype(complex)


def growth(method: Method, modes: Modes, substeps: int) -> float:
    """Largest factor |R(h s)| by which a step of h = DT / substeps multiplies a mode s that does not grow by itself."""
    decaying = modes[modes.real <= GROWTH]
    return max(abs(_stability_function(method, s * DT / substeps)) for s in decaying)


def enough_substeps(method: Method, modes: Modes) -> int | None:
    """Smallest stable number of steps in a command period, or None."""
    numbers = range(1, MAX_SUBSTEPS + 1)
    return next((k for k in numbers if growth(method, modes, k) <= 1.0 + GROWTH), None)


def _stability_function(method: Method, z: complex) -> complex:
    """R(z): what one step of an explicit method makes of y' = z y, y = 1; k_i = z (1 + sum_j a_ij k_j), R = 1 + sum_i b_i k_i."""
    slopes: list[complex] = []
    for row in method.A:
        slopes.append(z * (1.0 + sum(a * k for a, k in zip(row, slopes, strict=False))))
    return 1.0 + sum(b * k for b, k in zip(method.B, slopes, strict=True))
