# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Heading of the IMU alone: gyro and orientation, whichever the sensor measures.

    psi' = w - b + noise,   z = psi + noise

z is the yaw of the orientation, whose zero is unknown (game rotation vector); so is the zero of the result. The gyro's
noise follows the innovations: a gyro that contradicts its own orientation counts less, and the heading then follows the
orientation. Source: linear Kalman filter, process noise adapted by the ratio of the innovations to their variance.
The two may have different delays; `heading_lead` finds by how much the heading that results leads the gyro.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fish_control.heading_lead import MEMORY, HeadingLead
from fish_control.offset_sums import ClockEstimate

SAMPLE_PERIOD = 0.01  # s, for which noises per sample are given
COASTING_TIME = 0.1  # s, for which an unknown rate keeps its sign
ADAPTATION = 0.02  # per sample, of the logarithm of the gyro's variance
LARGEST_RATIO = 1e5  # of the gyro's variance to the given one
WILD = 9.0  # squared innovations count no more than this many variances
RESET = 1.0  # rad, an orientation that jumps by more has a new zero
BIAS_STD = 0.05  # rad/s, of the gyro's bias at first
ROUNDING = 1e-9  # s, of the time between two samples


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
