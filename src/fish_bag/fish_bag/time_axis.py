# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One time axis for all topics of a trial, whatever machines their stamps and arrivals come from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fish_bag.clock import ClockEstimate, estimate_clock, robust_line

MASTER = "robot"  # the clock that commands are stamped with: physics is simulated on its time
RECORDER = "recorder"
FUTURE_S = 1e-3  # stamps may lie so far after the arrival before the clock is called another one
APART_S = 2.0  # latencies of two topics differ by less, also on a computer that is too slow
OUTLIER_S = 5.0  # a stamp so far off the recording's trend is wrong
NEIGHBOURS = 11  # messages that make the trend of a clock that may stand still


@dataclass(frozen=True)
class Stamps:
    """Stamps and arrivals of one topic, (N,) int64 ns."""

    topic: str
    clock: str
    stamp_ns: np.ndarray
    arrival_ns: np.ndarray
    steady: bool = True  # False: a simulator's clock, which waits for a busy computer

    @property
    def plausible(self) -> np.ndarray:
        """(N,) bool: arrival minus stamp follows the recording's trend up to OUTLIER_S.

        The trend is a line, or, of a clock that is not steady, the median of the messages around.
        """
        delay = self.arrival_ns - self.stamp_ns
        d = (delay - int(np.median(delay))) * 1e-9
        if not self.steady:
            from scipy.ndimage import median_filter  # rarely needed, and slow to import

            return np.asarray(np.abs(d - median_filter(d, NEIGHBOURS, mode="nearest")) < OUTLIER_S)
        x = (self.arrival_ns - self.arrival_ns[0]) * 1e-9
        return np.asarray(np.abs(d - robust_line(x, d)) < OUTLIER_S)


@dataclass(frozen=True)
class TimeAxis:
    """Maps stamps and arrivals to seconds from origin_ns on the clock `clock`."""

    origin_ns: int
    clock: str  # RECORDER when stamps and arrivals agree, else MASTER
    clocks: dict[str, ClockEstimate]

    def measured(self, clock: str, stamp_ns: np.ndarray) -> np.ndarray:
        """(N,) stamps of `clock` in seconds on the axis."""
        estimate = self.clocks.get(clock)
        if (
            clock == self.clock
            or estimate is None
            or (self.clock == RECORDER and not estimate.applied)
        ):
            return (stamp_ns - self.origin_ns) * 1e-9
        if self.clock == RECORDER:
            return estimate.to_recorder(stamp_ns, self.origin_ns)
        if not estimate.applied:
            return self.arrived(stamp_ns)
        start_ns = estimate.middle_ns + round(estimate.offset_s * 1e9)
        recorder_ns = start_ns + np.round(estimate.to_recorder(stamp_ns, start_ns) * 1e9).astype(
            np.int64
        )
        return self.arrived(recorder_ns)

    def arrived(self, arrival_ns: np.ndarray) -> np.ndarray:
        """(N,) arrivals (recorder's clock) in seconds on the axis."""
        if self.clock == RECORDER:
            return (arrival_ns - self.origin_ns) * 1e-9
        return self.clocks[self.clock].from_recorder(arrival_ns, self.origin_ns)


def build_axis(stamps: list[Stamps], first_arrival_ns: int, max_latency_s: float) -> TimeAxis:
    """Compare every clock with the recorder's and choose the axis.

    A clock whose shortest latency lies in 0..max_latency_s is taken for the recorder's: the offset cannot
    be told from latency then and nothing is moved. Otherwise its stamps are moved by the estimate. If that
    clock is the robot's (two machines, or simulation time against wall time), the axis is the robot's and
    arrivals are moved instead.
    """
    clocks = {}
    for name in dict.fromkeys(s.clock for s in stamps):
        estimate = _estimate(name, [s for s in stamps if s.clock == name], max_latency_s)
        if estimate is not None:
            clocks[name] = estimate
    master = clocks.get(MASTER)
    if master is None or not master.applied:
        return TimeAxis(first_arrival_ns, RECORDER, clocks)
    origin = master.from_recorder(np.array([first_arrival_ns]), master.middle_ns)[0]
    return TimeAxis(master.middle_ns + round(origin * 1e9), MASTER, clocks)


def clocks_apart(stamps: list[Stamps]) -> dict[str, float]:
    """Topics whose stamps are of another clock than those of the first topic of their clock, and by how much [s].

    Topics of one clock differ by their latencies only; more than APART_S between them is another clock, such as one
    in another time zone or one that counts from the start of the computer. Clocks that stand still are not judged.
    """
    first: dict[str, Stamps] = {}
    apart = {}
    for one in stamps:
        other = first.setdefault(one.clock, one)
        if other is one or not (one.steady and len(one.stamp_ns) and len(other.stamp_ns)):
            continue
        base = int(np.median(other.arrival_ns - other.stamp_ns))
        late, usual = (
            ((s.arrival_ns - s.stamp_ns - base) * 1e-9)[np.argsort(s.arrival_ns)]
            for s in (one, other)
        )
        at, known = np.sort(one.arrival_ns), np.sort(other.arrival_ns)
        start = int(known[0])
        distance = float(np.median(late - np.interp(at - start, known - start, usual)))
        if abs(distance) > APART_S:
            apart[one.topic] = -distance
    return apart


def _estimate(name: str, stamps: list[Stamps], max_latency_s: float) -> ClockEstimate | None:
    good = [s.plausible for s in stamps]
    stamp_ns = np.concatenate([s.stamp_ns[g] for s, g in zip(stamps, good, strict=True)])
    arrival_ns = np.concatenate([s.arrival_ns[g] for s, g in zip(stamps, good, strict=True)])
    if not len(stamp_ns):
        return None
    estimate = estimate_clock(name, tuple(s.topic for s in stamps), stamp_ns, arrival_ns)
    same = -FUTURE_S <= estimate.offset_s <= max_latency_s
    return replace(estimate, applied=not same)
