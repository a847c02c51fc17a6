"""The IMU's recent samples, and what it measured in between."""

from __future__ import annotations

import bisect
from typing import NamedTuple


class InertialSample(NamedTuple):
    """One IMU measurement in base_link."""

    yaw_rate: float  # rad/s
    forward: float  # m/s^2, specific force
    left: float  # m/s^2


class ImuHistory:
    """Samples in the order of their stamps."""

    def __init__(self, reach: float) -> None:
        self.reach = reach  # s, a sample says nothing about moments farther away
        self._times: list[float] = []
        self._samples: list[InertialSample] = []

    def add(self, time: float, sample: InertialSample) -> None:
        """Append a sample that is newer than all others."""
        self._times.append(time)
        self._samples.append(sample)

    def at(self, time: float) -> InertialSample | None:
        """Linear between the neighbouring samples; if only one is in reach, that one; None without any."""
        i = bisect.bisect_right(self._times, time)
        before = i - 1 if i > 0 and time - self._times[i - 1] <= self.reach else None
        after = i if i < len(self._times) and self._times[i] - time <= self.reach else None
        if before is None or after is None:
            only = before if before is not None else after
            return None if only is None else self._samples[only]
        share = (time - self._times[before]) / (self._times[after] - self._times[before])
        a, b = self._samples[before], self._samples[after]
        return InertialSample(
            a.yaw_rate + share * (b.yaw_rate - a.yaw_rate),
            a.forward + share * (b.forward - a.forward),
            a.left + share * (b.left - a.left),
        )

    def times(self, start: float, end: float) -> list[float]:
        """Stamps [s] of the samples between `start` and `end`, without those two."""
        return self._times[
            bisect.bisect_right(self._times, start) : bisect.bisect_left(self._times, end)
        ]

    def forget(self, before: float) -> None:
        """Drop samples older than `before` [s]."""
        keep = bisect.bisect_left(self._times, before)
        del self._times[:keep], self._samples[:keep]
