# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The time offset at which two headings change alike, from sums of squares over a grid of offsets.

    S(o | p) = sum over k of exp(-age_k / memory) (a(t_k) - a(t_k - lag) - b(t_k + o) + b(t_k - lag + o))^2

over the pairs k of which b is known at the offset o and at the offset p; n(p) is the same sum of 1 for those known at p. The
best offset p has the smallest S(p | p) / n(p). Two offsets are compared by the pairs that both know, and by no other:

    log L(o) - log L(p) = -(S(o | p) - S(p | o)) / (2 CORRELATION s^2),   s^2 = S(p | p) / n(p)

A parabola through the best and its neighbours gives the value between grid points, its curvature the variance. Source: time
delay estimation by least squares (Jacovitti and Scarano 1993), on a grid with forgetting.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LAG = 0.15  # s between the two poses of a pair, a third of a stroke
STEP = 0.01  # s, of the grid
CLIP = 0.3  # rad, larger differences count no more
CORRELATION = 2.0  # variance of the estimate to that of independent pairs: each pose is in two
MODEL_STD = 3e-4  # s, of what the noise does not explain
NEIGHBOURHOOD = 0.08  # s, within which offsets belong to one minimum
CLEAR = 10.0  # log-likelihood by which every other minimum must be worse
CLEAR_RATIO = 1.3  # and the ratio of the sums of squares
LARGEST_STD = 0.005  # s, of an estimate that is applied
LEAST_PAIRS = 12.0  # that an offset must know before it may be the best
LEAST_SQUARE = 1e-8  # rad^2
REACH = 0.2  # s, less than half a stroke, in which an offset is looked for that has changed


@dataclass(frozen=True)
class ClockEstimate:
    """Offset of one clock to another."""

    offset: float  # s, added to a stamp of the camera to get the IMU's time
    std: float  # s
    sure: bool  # whether it may be applied

    def agrees(self, offset: Array) -> Mask:
        """Whether it may be one of these [s], to a step of the grid."""
        agrees: Mask = np.abs(offset - self.offset) <= max(2.0 * self.std, STEP)
        return agrees


class OffsetSums:
    """Sums of squares over the grid with one memory."""

    def __init__(self, memory: float, size: int) -> None:
        self._memory = memory
        self._squares = np.zeros((size, size))  # [o, p]: S(o | p)
        self._pairs = np.zeros(size)  # n

    def add(
        self, squares: Array, dt: float = 0.0, known: Mask | None = None, pairs: int = 1
    ) -> None:
        """The squares (G,) [rad^2] of one more pair, or the sums of several, dt [s] after the last.

        known (G,): at which offsets b is known; None: at all.
        """
        keep = math.exp(-max(dt, 0.0) / self._memory)
        knows = 1.0 if known is None or known.all() else known.astype(float)
        self._squares *= keep
        self._squares += (squares * knows)[:, None] * knows
        self._pairs *= keep
        self._pairs += pairs * knows

    def known(self, least: float = LEAST_PAIRS) -> Mask:
        """Which offsets know at least so many pairs (G,)."""
        known: Mask = self._pairs >= least
        return known

    def best(self, among: Mask) -> int:
        """Which of the offsets `among` (G,) has the smallest mean square; each of them knows a pair."""
        mean = np.full(len(among), np.inf)
        np.divide(self._squares.diagonal(), self._pairs, out=mean, where=among)
        return int(mean.argmin())

    def log_likelihood(self, best: int) -> Array:
        """Of each offset less that of `best`; 0 where they have no pair in common."""
        excess: Array = self._squares[:, best] - self._squares[best]
        variance = max(float(self._squares[best, best] / self._pairs[best]), LEAST_SQUARE)
        return -excess / (2.0 * CORRELATION * variance)

    def estimate(
        self, grid: Array, around: float | None = None, expected: ClockEstimate | None = None
    ) -> ClockEstimate:
        """The best offset of the grid, or of what lies within REACH of `around` [s].

        It is sure where every other one is excluded: by the pairs or, if it knows too few of them, by the `expected` offset, with
        which the best agrees and it does not.
        """
        within = np.ones(len(grid), dtype=bool)
        if around is not None:
            within = np.abs(grid - around) <= REACH
        among = within & self.known()
        best = self.best(among)
        unsure = ClockEstimate(float(grid[best]), math.inf, False)
        edge = best < 2 or best > len(grid) - 3
        if edge or not among[best]:
            return unsure
        likelihood = self.log_likelihood(best)
        before, after = -likelihood[best - 1], -likelihood[best + 1]
        curvature = before + after  # per STEP^2
        if curvature <= 0.5 * abs(before - after):  # no minimum between the neighbours
            return unsure
        offset = float(grid[best] + 0.5 * STEP * (before - after) / curvature)
        std = math.hypot(STEP / math.sqrt(curvature), MODEL_STD)
        other = within & (np.abs(grid - grid[best]) > NEIGHBOURHOOD)
        if expected is not None and expected.agrees(grid[best]):
            other &= self.known() | expected.agrees(grid)
        clear = likelihood.max(where=other, initial=-math.inf) < -CLEAR
        distinct = np.all(self._squares[other, best] > CLEAR_RATIO * self._squares[best, other])
        return ClockEstimate(offset, std, bool(clear and distinct and std < LARGEST_STD))
