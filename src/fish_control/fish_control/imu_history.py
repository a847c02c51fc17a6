# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The IMU's recent samples as arrays: integrated heading and specific force."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fish_control.imu_heading import ROUNDING, HeadingStep

Array = NDArray[np.float64]
CAPACITY = 4096  # rows; the older half is dropped when they are full

TIME, YAW, RATE, FORWARD, LEFT, SPREAD, YAW_KNOWN, ACCEL_KNOWN, GAPS = range(9)  # columns
COLUMNS = 9


class InertialSample(NamedTuple):
    """What the IMU says about one moment, in base_link."""

    yaw: float  # rad, heading since an unknown start, continuous
    yaw_rate: float  # rad/s
    forward: float  # m/s^2, specific force
    left: float  # m/s^2
    yaw_variance: float = (
        0.0  # rad^2, by which the heading's change since the sample before is uncertain
    )
    yaw_known: bool = True  # whether the heading was measured since the sample before
    accel_known: bool = True


def inertial_sample(step: HeadingStep, forward: float | None, left: float | None) -> InertialSample:
    """A sample from what it adds to the heading and its specific force [m/s^2]; None: not measured."""
    known = forward is not None and left is not None
    force = forward or 0.0, left or 0.0
    return InertialSample(step.yaw, step.yaw_rate, *force, step.variance, step.known, known)


class Step(NamedTuple):
    """The IMU between two moments with no sample between them."""

    dt: float  # s
    turn: float  # rad, change of the heading
    yaw_variance: float  # rad^2, of the turn
    forward: float  # m/s^2, mean specific force
    left: float  # m/s^2
    yaw_known: bool  # whether the heading was measured
    accel_known: bool


class ImuHistory:
    """Samples in the order of their stamps.

    Args:
        reach: s, a sample says nothing about moments farther away.
        place: x, y of the IMU in base_link [m]. The steps give the specific force of the centre of mass:

            f = f_imu - alpha x r - omega x (omega x r)

            in the plane, with yaw rate omega and its change alpha. Source: rigid-body kinematics.
    """

    def __init__(self, reach: float, place: tuple[float, float] = (0.0, 0.0)) -> None:
        self.reach, self._place = reach, place
        self._near = reach + ROUNDING  # s, up to which two samples say what was between them
        self._rows = np.zeros((CAPACITY, COLUMNS))
        self._begin = self._end = 0

    def __len__(self) -> int:
        return self._end - self._begin

    @property
    def times(self) -> Array:
        """Stamps (N,) [s]."""
        return self._rows[self._begin : self._end, TIME]

    @property
    def yaw(self) -> Array:
        """Continuous heading (N,) [rad]."""
        return self._rows[self._begin : self._end, YAW]

    @property
    def first_time(self) -> float:
        """Stamp of the earliest sample [s]; inf without one."""
        return float(self._rows[self._begin, TIME]) if len(self) else math.inf

    @property
    def last_time(self) -> float:
        """Stamp of the newest sample [s]; -inf without one."""
        return float(self._rows[self._end - 1, TIME]) if len(self) else -math.inf

    def add(self, time: float, sample: InertialSample) -> None:
        """Append a sample that is newer than all others."""
        if self._end == CAPACITY:
            kept = self._rows[max(self._begin, CAPACITY // 2) : self._end].copy()
            self._begin, self._end = 0, len(kept)
            self._rows[: self._end] = kept
        s, gaps = sample, 0.0
        if len(self):
            before = self._rows[self._end - 1]
            gaps = before[GAPS] + (not s.yaw_known or time - before[TIME] > self._near)
        self._rows[self._end] = (
            time,
            s.yaw,
            s.yaw_rate,
            s.forward,
            s.left,
            s.yaw_variance,
            s.yaw_known,
            s.accel_known,
            gaps,
        )
        self._end += 1

    def forget(self, before: float) -> None:
        """Drop samples older than `before` [s], but not the newest of them."""
        self._begin += max(0, int(self.times.searchsorted(before)) - 1)

    def yaw_rate(self, time: float) -> float | None:
        """Yaw rate [rad/s] of the sample nearest to `time` [s]; None if none is in reach or it was not measured."""
        if not len(self):
            return None
        i = self._begin + int(self.times.searchsorted(time))
        around = self._rows[max(i - 1, self._begin) : min(i + 1, self._end)].tolist()
        row = min(around, key=lambda row: abs(row[TIME] - time))
        known = abs(row[TIME] - time) <= self.reach and row[YAW_KNOWN]
        return row[RATE] if known else None

    def heading(self, times: Array) -> Array:
        """Continuous heading [rad] at `times` [s], linear between the samples and constant beyond them."""
        return np.interp(times, self.times, self.yaw)

    def gaps(self, times: Array) -> Array:
        """How many gaps of the heading are before `times` [s], and the share of one that a time is in; NaN beyond the samples.

        The change of the heading was measured between times with the same number.
        """
        gaps = self._rows[self._begin : self._end, GAPS]
        return np.interp(times, self.times, gaps, math.nan, math.nan)

    def between(self, start: float, end: float) -> list[Step]:
        """The IMU from `start` to `end` [s], cut at its samples.

        A step is known where the samples around it are no more than `reach` apart; beyond the first and the last
        sample their values hold as far as they reach.
        """
        t = self.times
        if not len(t):
            return [Step(end - start, 0.0, 0.0, 0.0, 0.0, False, False)]
        first = int(t.searchsorted(start, side="right"))
        last = int(t.searchsorted(end, side="left"))
        skipped = max(first - 1, 0)
        # plain numbers: most intervals have one to four steps, for which arrays cost many times as much
        rows = self._rows[self._begin + skipped : min(self._begin + last + 1, self._end)].tolist()
        steps, before = [], _Knot(start, rows, max(first - skipped, 1))
        for k in range(first - skipped, last - skipped + 1):
            ends = k == last - skipped
            after = _Knot(end if ends else rows[k][TIME], rows, max(k, 1))
            steps.append(
                self._step(before, after, rows[max(k - 1, 0)], rows[min(k, len(rows) - 1)])
            )
            before = after
        return steps

    def _step(self, before: _Knot, after: _Knot, a: list[float], b: list[float]) -> Step:
        """Between two knots; a, b: the samples around the step, the same one where it lies beyond all samples."""
        dt, apart = after.time - before.time, b[TIME] - a[TIME]
        share = 1.0
        if a is b:
            apart = max(after.time - b[TIME], b[TIME] - before.time)
        else:
            share = min(max(dt / apart, 0.0), 1.0)
        near = apart <= self._near
        x, y = self._place
        alpha = (after.rate - before.rate) / dt if dt > 0.0 else 0.0
        square = (before.rate**2 + before.rate * after.rate + after.rate**2) / 3.0
        return Step(
            dt,
            after.yaw - before.yaw,
            b[SPREAD] * share,
            0.5 * (before.forward + after.forward) + alpha * y + square * x,
            0.5 * (before.left + after.left) - alpha * x + square * y,
            near and b[YAW_KNOWN] > 0.0,
            near and a[ACCEL_KNOWN] * b[ACCEL_KNOWN] > 0.0,
        )


class _Knot:
    """Heading, its rate and specific force at a time [s], linear between samples k - 1 and k; beyond the last the rate holds."""

    __slots__ = ("forward", "left", "rate", "time", "yaw")

    def __init__(self, time: float, rows: list[list[float]], k: int) -> None:
        self.time = time
        a = rows[k - 1]
        if k >= len(rows) or time <= a[TIME]:  # beyond the last, or before the first
            beyond = max(time - a[TIME], 0.0)
            self.yaw = a[YAW] + a[RATE] * beyond
            self.forward, self.left, self.rate = a[FORWARD], a[LEFT], a[RATE]
            return
        b = rows[k]
        share = (time - a[TIME]) / (b[TIME] - a[TIME])
        self.yaw = a[YAW] + share * (b[YAW] - a[YAW])
        self.forward = a[FORWARD] + share * (b[FORWARD] - a[FORWARD])
        self.left = a[LEFT] + share * (b[LEFT] - a[LEFT])
        self.rate = a[RATE] + share * (b[RATE] - a[RATE])
