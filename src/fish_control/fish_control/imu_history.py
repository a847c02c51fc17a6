# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The IMU's recent samples as arrays: integrated heading and specific force."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CAPACITY = 4096  # rows; the older half is dropped when they are full

TIME, YAW, RATE, FORWARD, LEFT, SPREAD, YAW_KNOWN, ACCEL_KNOWN = range(8)  # columns
COLUMNS = 8


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


class Interval(NamedTuple):
    """The IMU between two moments, cut at its samples: n steps between n + 1 knots."""

    time: Array  # (n + 1,) s
    yaw: Array  # (n + 1,) rad
    accel: Array  # (n + 1, 2) m/s^2, forward and left
    yaw_variance: Array  # (n,) rad^2 of each step
    yaw_known: NDArray[np.bool_]  # (n,)
    accel_known: NDArray[np.bool_]  # (n,)


class ImuHistory:
    """Samples in the order of their stamps."""

    def __init__(self, reach: float) -> None:
        self.reach = reach  # s, a sample says nothing about moments farther away
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
        s = sample
        self._rows[self._end] = (
            time,
            s.yaw,
            s.yaw_rate,
            s.forward,
            s.left,
            s.yaw_variance,
            s.yaw_known,
            s.accel_known,
        )
        self._end += 1

    def forget(self, before: float) -> None:
        """Drop samples older than `before` [s], but not the newest of them."""
        self._begin += max(0, int(np.searchsorted(self.times, before)) - 1)

    def yaw_rate(self, time: float) -> float | None:
        """Yaw rate [rad/s] of the sample nearest to `time` [s]; None if none is in reach or it was not measured."""
        if not len(self):
            return None
        rows = self._rows[self._begin : self._end]
        i = int(np.searchsorted(rows[:, TIME], time))
        near = min(
            (k for k in (i - 1, i) if 0 <= k < len(rows)), key=lambda k: abs(rows[k, TIME] - time)
        )
        row = rows[near]
        known = abs(row[TIME] - time) <= self.reach and bool(row[YAW_KNOWN])
        return float(row[RATE]) if known else None

    def heading(self, times: Array) -> Array:
        """Continuous heading [rad] at `times` [s], linear between the samples and constant beyond them."""
        return np.interp(times, self.times, self.yaw)

    def between(self, start: float, end: float) -> Interval:
        """The IMU from `start` to `end` [s].

        A step is known where the samples around it are no more than `reach` apart; beyond the first and the last
        sample their values hold as far as they reach.
        """
        rows = self._rows[self._begin : self._end]
        t = rows[:, TIME]
        first, last = np.searchsorted(t, start, side="right"), np.searchsorted(t, end, side="left")
        time = np.concatenate(([start], t[first:last], [end]))
        steps = len(time) - 1
        if not len(rows):
            unknown = np.zeros(steps, dtype=bool)
            return Interval(time, np.zeros(2), np.zeros((2, 2)), np.zeros(1), unknown, unknown)
        after = np.arange(first, last + 1)  # of each step, the sample that ends it
        a, b = np.clip(after - 1, 0, None), np.clip(after, None, len(rows) - 1)
        apart = np.where(a == b, np.maximum(time[1:] - t[-1], t[0] - time[:-1]), t[b] - t[a])
        near = apart <= self.reach + 1e-9
        share = np.where(a == b, 1.0, np.diff(time) / np.where(a == b, 1.0, t[b] - t[a]))
        yaw = np.interp(time, t, rows[:, YAW])
        if end > t[-1]:  # the newest rate holds
            yaw[-1] += rows[-1, RATE] * (end - max(start, t[-1]))
            yaw[0] += rows[-1, RATE] * max(0.0, start - t[-1])
        accel = np.column_stack([np.interp(time, t, rows[:, c]) for c in (FORWARD, LEFT)])
        return Interval(
            time,
            yaw,
            accel,
            rows[b, SPREAD] * np.clip(share, 0.0, 1.0),
            near & (rows[b, YAW_KNOWN] > 0.0),
            near & (rows[a, ACCEL_KNOWN] * rows[b, ACCEL_KNOWN] > 0.0),
        )
