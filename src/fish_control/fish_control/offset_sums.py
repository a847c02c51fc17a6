# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The time offset at which two headings change alike, from sums of squares over a grid of offsets.

    S(o) = sum over k of exp(-age_k / memory) (a(t_k) - a(t_k - lag) - b(t_k + o) + b(t_k - lag + o))^2

A parabola through the smallest three gives the value between grid points, its curvature the standard deviation. Source:
time delay estimation by least squares (Jacovitti and Scarano 1993), on a grid with forgetting.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LAG = 0.15  # s between the two poses of a pair, a third of a stroke
STEP = 0.01  # s, of the grid
CLIP = 0.3  # rad, larger differences count no more
CORRELATION = 2.0  # variance of the estimate to that of independent pairs: each pose is in two
MODEL_STD = 3e-4  # s, of what the noise does not explain
NEIGHBOURHOOD = 0.08  # s, within which offsets belong to one minimum
CLEAR = 10.0  # log-likelihood by which every other minimum must be worse
CLEAR_RATIO = 1.3  # and the ratio of the sums of squares
LARGEST_STD = 0.005  # s, of an estimate that is applied
LEAST_PAIRS = 12.0
REACH = 0.2  # s, less than half a stroke, in which an offset is looked for that has changed


@dataclass(frozen=True)
class ClockEstimate:
    """Offset of one clock to another."""

    offset: float  # s, added to a stamp of the camera to get the IMU's time
    std: float  # s
    sure: bool  # whether it may be applied


class OffsetSums:
    """Sums of squares over the grid with one memory."""

    def __init__(self, memory: float, size: int) -> None:
        self.memory = memory
        self.squares = np.zeros(size)
        self.pairs = 0.0

    def add(self, squares: Array, dt: float) -> None:
        """One more pair's squares (G,) [rad^2], dt [s] after the last."""
        keep = math.exp(-max(dt, 0.0) / self.memory)
        self.squares = keep * self.squares + squares
        self.pairs = keep * self.pairs + 1.0

    def log_likelihood(self) -> Array:
        """Of each offset, less that of the best: at most 0."""
        best = float(self.squares.min())
        variance = max(best / max(self.pairs, 1.0), 1e-8)
        return (best - self.squares) / (2.0 * CORRELATION * variance)

    def estimate(self, grid: Array, around: float | None = None) -> ClockEstimate:
        """The best offset of the grid, or of what lies within REACH of `around` [s]."""
        within = np.ones(len(grid), dtype=bool)
        if around is not None:
            within = np.abs(grid - around) <= REACH
        best = int(np.where(within, self.squares, np.inf).argmin())
        edge = best < 2 or best > len(grid) - 3
        if edge or self.pairs < LEAST_PAIRS:
            return ClockEstimate(float(grid[best]), math.inf, False)
        a, b, c = self.squares[best - 1 : best + 2]
        curvature = a - 2.0 * b + c
        if curvature <= 0.0:
            return ClockEstimate(float(grid[best]), math.inf, False)
        offset = float(grid[best] + 0.5 * STEP * (a - c) / curvature)
        variance = max(b / self.pairs, 1e-8) * CORRELATION / (0.5 * curvature / STEP**2)
        std = math.hypot(math.sqrt(variance), MODEL_STD)
        other = within & (np.abs(grid - grid[best]) > NEIGHBOURHOOD)
        clear = self.log_likelihood()[other].max() < -CLEAR
        distinct = self.squares[other].min() > CLEAR_RATIO * b
        return ClockEstimate(offset, std, bool(clear and distinct and std < LARGEST_STD))
