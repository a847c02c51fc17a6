# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Steps of the filter's pass in NumPy: the flow of a linear system over a step, and the Kalman update."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.estimation.ekf_types import ROWS, Array, History

SERIES = 8  # terms of the matrix exponential, as in c/ekf.c


def between(x0: Array, x1: Array, rate0: Array, rate1: Array, c: float) -> Array:
    """Motion (M, nx) at a fraction c of the period from x0 to x1 with these rates at its ends: Hermite's cubic."""
    bend = (1.0 - c) * DT * rate0 - c * DT * rate1
    blended: Array = x0 + (x1 - x0) * c * c * (3.0 - 2.0 * c) + c * (1.0 - c) * bend
    return blended


def flow(A: Array, b: Array, h: float, y: Array) -> Array:
    """exp(A h) y + (integral of exp(A s) over 0 .. h) b by the series; A (M, nx, nx), b and y (M, nx, R)."""
    total, term = y, y
    for m in range(1, SERIES + 1):
        term = h / m * (A @ term + (b if m == 1 else 0.0))
        total = total + term
    return total


class Sums:
    """What a pass adds up."""

    def __init__(self, trials: int, free: int, steps: int) -> None:
        self.log_likelihood, self.samples = np.zeros(trials), np.zeros(trials)
        self.gradient, self.normal = np.zeros((trials, free)), np.zeros((trials, free, free))
        self.whitened = np.full((steps, trials, len(ROWS) + 1), np.nan)


def update(
    k: int,
    rows: slice,
    e: Array,
    H: Array,
    dh: Array,
    R: Array,
    use: NDArray[np.bool_],
    gate: float,
    state: tuple[Array, Array, Array],
    sums: Sums,
) -> tuple[Array, Array, Array]:
    """Kalman update of the trials in `use`; innovations beyond `gate` (squared, normalised) are left out."""
    xi, P, D = state
    PHt = P @ H.transpose(0, 2, 1)
    S, L, sound = _factored(H @ PHt + R)
    use = use & sound
    e = np.where(use[:, None], e, 0.0)
    white = np.linalg.solve(L, e[..., None])[..., 0]
    use = use & (np.sum(white**2, axis=1) < gate)
    e = np.where(use[:, None], e, 0.0)
    white = np.where(use[:, None], white, 0.0)
    # derivative of the whitened innovation
    J = np.where(use[:, None, None], -np.linalg.solve(L, dh), 0.0)
    K = np.where(
        use[:, None, None], np.linalg.solve(S, PHt.transpose(0, 2, 1)).transpose(0, 2, 1), 0.0
    )
    xi = xi + (K @ e[..., None])[..., 0]
    D = D - K @ dh
    P = P - K @ PHt.transpose(0, 2, 1)
    log_det = 2.0 * np.sum(np.log(np.diagonal(L, axis1=1, axis2=2)), axis=1)
    size = e.shape[1]
    sums.log_likelihood -= 0.5 * np.where(
        use, np.sum(white**2, axis=1) + log_det + size * np.log(2 * np.pi), 0.0
    )
    sums.samples += size * use
    sums.gradient += np.einsum("mi,mik->mk", white, J)
    sums.normal += J.transpose(0, 2, 1) @ J
    sums.whitened[k, use, rows] = white[use]
    return xi, P, D


def _factored(S: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(S, L, which): S (M, 3, 3) and its lower Cholesky factors; the unit matrix for both where S has none or no inverse.

    Rounding leaves a filter neither that is about to be lost.
    """
    try:
        return S, _factor(S), np.ones(len(S), dtype=bool)
    except np.linalg.LinAlgError:
        sound = np.array([_is_sound(own) for own in S], dtype=bool)
        S = np.where(sound[:, None, None], S, np.eye(3))
        return S, _factor(S), sound


def _factor(S: Array) -> Array:
    """The Cholesky factor. Raises LinAlgError where S has none, or no inverse."""
    np.linalg.inv(S)
    return np.asarray(np.linalg.cholesky(S), dtype=np.float64)


def _is_sound(S: Array) -> bool:
    try:
        _factor(S)
    except np.linalg.LinAlgError:
        return False
    return True


def empty_history(T: int, M: int, n: int, memory: Array) -> History:
    """Zeros, for T grid points of M trials with n states, and the memory (T + 1, M, NM)."""
    return History(
        np.zeros((T, M, n)),
        np.zeros((T, M, n, n)),
        np.zeros((T, M, n)),
        np.zeros((T, M, n, n)),
        np.zeros((T, M, n, n)),
        memory,
    )
