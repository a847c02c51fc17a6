# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""By how much an IMU's heading leads its own gyro: an orientation that the sensor computes has another delay than its gyro.

    psi(t) = G(t + lead),   G = integral of the gyro

Changes over LAG are compared as in `offset_sums`. An image found at t + o of the heading's clock was taken at
t + o + lead of the gyro's.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from fish_control.offset_sums import CLIP, LAG, STEP, ClockEstimate, OffsetSums

Array = NDArray[np.float64]

LARGEST = 0.1  # s, of the grid's leads
MEMORY = 20.0  # s
PERIOD = 0.5 * LAG  # s between comparisons: each moment is in two, as with the camera
GRID: Array = STEP * np.arange(-round(LARGEST / STEP), round(LARGEST / STEP) + 1, dtype=np.float64)
# s of samples that one comparison needs, with one more on each side
WINDOW = LAG + 2.0 * LARGEST + 0.1


def against_gyro(offset: ClockEstimate, lead: ClockEstimate) -> ClockEstimate:
    """The camera's offset to the gyro's clock, from that to the heading's clock and the heading's lead."""
    std = math.hypot(offset.std, lead.std)
    return ClockEstimate(offset.offset + lead.offset, std, offset.sure and lead.sure)


class HeadingLead:
    """Feed it every sample of the IMU in order.

    Args:
        reach: s, longer gaps between samples hide what the fish did.
        memory: s.
    """

    def __init__(self, reach: float, memory: float = MEMORY) -> None:
        self._reach = reach
        self._sums = OffsetSums(memory, len(GRID))
        # time, gyro, integral of the gyro, heading
        self._rows = deque[tuple[float, float, float, float]]()
        self._compared: float | None = None  # s

    @property
    def current(self) -> ClockEstimate:
        """The lead [s], positive if the heading is earlier than the gyro; sure once the fish has turned to and fro."""
        return self._sums.estimate(GRID)

    def add(self, time: float, rate: float | None, heading: float) -> None:
        """A sample: gyro [rad/s] (None: not measured) and continuous heading [rad]."""
        if rate is None or (self._rows and not 0.0 < time - self._rows[-1][0] <= self._reach):
            self._rows.clear()
        if rate is None:
            return
        turned = 0.0
        if self._rows:
            before, rate_before, turned, _ = self._rows[-1]
            turned += 0.5 * (rate + rate_before) * (time - before)
        self._rows.append((time, rate, turned, heading))
        while len(self._rows) > 2 and self._rows[1][0] <= time - WINDOW:
            self._rows.popleft()
        waits = self._compared is not None and time - self._compared < PERIOD
        if not waits and self._rows[0][0] <= time - WINDOW:
            self._compare(time)

    def _compare(self, time: float) -> None:
        """One pair of samples, the later one LARGEST ago: the heading at the samples, the gyro's integral around them."""
        times, rate, turned, heading = np.array(self._rows).T
        later = int(np.searchsorted(times, time - LARGEST, side="right")) - 1
        earlier = int(np.searchsorted(times, times[later] - LAG + 1e-3, side="right")) - 1
        if earlier < 0 or times[earlier] + GRID[0] < times[0]:
            return
        change = heading[later] - heading[earlier]
        integral = [_integral(times[k] + GRID, times, rate, turned) for k in (later, earlier)]
        squares = np.minimum(np.abs(change - integral[0] + integral[1]), CLIP) ** 2
        self._sums.add(squares, time - (self._compared or time))
        self._compared = time


def _integral(at: Array, times: Array, rate: Array, turned: Array) -> Array:
    """Integral [rad] at `at` [s] of a rate that is linear between samples."""
    i = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    dt = at - times[i]
    slope = (rate[i + 1] - rate[i]) / (times[i + 1] - times[i])
    integral: Array = turned[i] + dt * (rate[i] + 0.5 * slope * dt)
    return integral
