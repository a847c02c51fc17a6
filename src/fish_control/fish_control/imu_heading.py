# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Heading of the IMU alone: gyro and orientation, whichever the sensor measures.

    psi' = w - b + noise,   z = psi + noise

z is the yaw of the orientation, whose zero is unknown (game rotation vector); so is the zero of the result. The gyro's
noise follows the innovations: a gyro that contradicts its own orientation counts less, and the heading then follows the
orientation. Source: linear Kalman filter, process noise adapted by the ratio of the innovations to their variance.

An orientation that the sensor computes has another delay than its gyro. `HeadingLead` finds by how much the heading leads:

    psi(t) = G(t + lead),   G = integral of the gyro

Changes over LAG are compared as in `offset_sums`. An image found at t + o of the heading's clock was taken at
t + o + lead of the gyro's.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

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


SAMPLE_PERIOD = 0.01  # s, for which noises per sample are given
COASTING_TIME = 0.1  # s, for which an unknown rate keeps its sign
ADAPTATION = 0.02  # per sample, of the logarithm of the gyro's variance
LARGEST_RATIO = 1e5  # of the gyro's variance to the given one
WILD = 9.0  # squared innovations count no more than this many variances
RESET = 1.0  # rad, an orientation that jumps by more has a new zero
BIAS_STD = 0.05  # rad/s, of the gyro's bias at first
ROUNDING = 1e-9  # s, of the time between two samples
LARGEST_YAW_STD = math.pi  # rad, of an orientation; with more it says nothing of the yaw


class HeadingNoise(NamedTuple):
    """Standard deviations of an IMU's yaw."""

    gyro: float  # rad/s per sample at 100 Hz
    gyro_drift: float  # rad/s per sqrt(s), of the bias
    unknown_rate: float  # rad/s, of a head whose rate nobody measures
    reach: float  # s, what happens in longer gaps between samples is unknown


class HeadingStep(NamedTuple):
    """What one sample adds."""

    yaw: float  # rad, continuous
    yaw_rate: float  # rad/s
    variance: float  # rad^2, of the heading's change since the sample before
    known: bool  # whether the change was measured


class ImuHeading:
    """Continuous heading from samples in order.

    Args:
        noise: standard deviations of the sensor.
        memory: s, of the lead on the gyro.
    """

    def __init__(self, noise: HeadingNoise, memory: float = MEMORY) -> None:
        self._noise = noise
        self._lead = HeadingLead(noise.reach, memory)
        self._time: float | None = None
        self._rate: float | None = None  # rad/s, newest of the gyro
        self._yaw = self._bias = 0.0
        self._zero: float | None = None  # rad, yaw of the orientation at heading 0
        self._P = (0.0, 0.0, BIAS_STD**2)  # of heading, heading and bias, bias
        self._ratio = 1.0  # of the gyro's variance to the given one

    @property
    def gyro_noise_ratio(self) -> float:
        """Standard deviation of the gyro, as its orientation shows it, to the given one."""
        return math.sqrt(self._ratio)

    @property
    def lead(self) -> ClockEstimate:
        """By how much the heading leads the gyro [s]."""
        return self._lead.current

    def add(
        self, time: float, rate: float | None, yaw: float | None = None, yaw_std: float = 0.003
    ) -> HeadingStep:
        """Take a sample at `time` [s]: yaw rate [rad/s], yaw of the orientation [rad]; None: not measured."""
        dt = 0.0 if self._time is None else time - self._time
        near = dt <= self._noise.reach + ROUNDING
        before, self._rate, self._time = self._rate, rate, time
        measured = rate is not None and near
        mean = 0.0
        if rate is not None and near:
            mean = (rate if before is None else 0.5 * (rate + before)) - self._bias
        variance = self._predict(mean, dt, measured)
        correction = 0.0
        if yaw is not None and yaw_std > LARGEST_YAW_STD:
            yaw = None
        if yaw is not None:
            correction = self._correct(yaw, yaw_std, measured)
            variance = min(variance, 2.0 * self._P[0])
        self._lead.add(time, rate, self._yaw)
        newest = 0.0 if rate is None else rate - self._bias
        turned = newest + (correction / dt if dt > 0.0 else 0.0)
        return HeadingStep(self._yaw, turned, variance, measured or (yaw is not None and near))

    def _predict(self, mean: float, dt: float, measured: bool) -> float:
        """Turn at `mean` [rad/s] for dt [s]; the variance of the turn [rad^2]."""
        n = self._noise
        if measured:
            variance = self._ratio * n.gyro**2 * SAMPLE_PERIOD * dt
        else:
            variance = n.unknown_rate**2 * COASTING_TIME * dt
        a, c, b = self._P
        a += variance - 2.0 * dt * c + dt * dt * b
        self._P = a, c - dt * b, b + n.gyro_drift**2 * dt
        self._yaw += mean * dt
        return variance

    def _correct(self, yaw: float, yaw_std: float, measured: bool) -> float:
        """Update with the orientation's yaw [rad]; by how much the heading moved [rad]."""
        if self._zero is None:
            self._zero = yaw - self._yaw
            self._P = (yaw_std**2, 0.0, BIAS_STD**2)
            return 0.0
        off = math.remainder(yaw - self._zero - self._yaw, 2.0 * math.pi)
        if measured and abs(off) > RESET:
            self._zero += off
            return 0.0
        a, c, b = self._P
        S = a + yaw_std**2
        if measured:
            self._ratio *= math.exp(ADAPTATION * (min(off * off / S, WILD) - 1.0))
            self._ratio = min(max(self._ratio, 1.0), LARGEST_RATIO)
        moved = a / S * off
        self._yaw += moved
        if measured:
            self._bias += c / S * off
        self._P = a - a * a / S, c - a * c / S, b - c * c / S
        return moved
