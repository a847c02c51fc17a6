# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One time axis for all topics of a trial, whatever machines their stamps and arrivals come from.

Offset and drift of a machine's clock against the recorder's follow from arrival times and stamps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

# the recording is cut into so many pieces of time; resampling them gives the uncertainty
BLOCKS = 40
LOWEST = 3  # points kept of each piece: only the lowest can touch the envelope
RESAMPLES = 50
FEWEST = 10  # messages; below this nothing is said about drift and uncertainty
MASTER = "robot"  # the clock that commands are stamped with: physics is simulated on its time
RECORDER = "recorder"
FUTURE_S = 1e-3  # stamps may lie so far after the arrival before the clock is called another one
APART_S = 2.0  # latencies of two topics differ by less, also on a computer that is too slow
OUTLIER_S = 5.0  # a stamp so far off the recording's trend is wrong
NEIGHBOURS = 11  # messages that make the trend of a clock that may stand still


@dataclass(frozen=True)
class ClockEstimate:
    """How the clock of some topics' stamps stands against the recorder's.

        recorder = stamp + offset + drift (stamp - middle),  offset known up to the shortest latency

    Arrival minus stamp is offset plus latency; latency is not negative, so the lower envelope is the offset
    plus the shortest latency on the way. `offset_s` is that envelope: the true offset is at most so much,
    and less by the shortest latency, which no recording can tell.
    """

    clock: str  # name from the topic map
    topics: tuple[str, ...]  # whose stamps it was estimated from
    offset_s: float  # at the middle of the recording
    offset_std_s: float  # of the envelope; nan with too few messages
    drift_ppm: float
    drift_std_ppm: float
    middle_ns: int  # stamp at which offset_s holds
    applied: bool = False  # whether times were moved by it

    @property
    def drift_is_significant(self) -> bool:
        """Whether drift differs from zero by more than three standard errors."""
        return abs(self.drift_ppm) > 3 * self.drift_std_ppm

    @property
    def _drift(self) -> float:
        return self.drift_ppm * 1e-6 if self.drift_is_significant else 0.0

    def to_recorder(self, stamp_ns: np.ndarray, origin_ns: int) -> np.ndarray:
        """Stamps of this clock on the recorder's, float seconds from origin_ns (recorder's time)."""
        elapsed = (stamp_ns - self.middle_ns) * 1e-9
        return (self.middle_ns - origin_ns) * 1e-9 + elapsed * (1 + self._drift) + self.offset_s

    def from_recorder(self, recorder_ns: np.ndarray, origin_ns: int) -> np.ndarray:
        """Times of the recorder on this clock, float seconds from origin_ns (this clock's time)."""
        shift = round(self.offset_s * 1e9)
        elapsed = (recorder_ns - self.middle_ns - shift) * 1e-9 / (1 + self._drift)
        return (self.middle_ns - origin_ns) * 1e-9 + elapsed


def estimate_clock(
    clock: str, topics: tuple[str, ...], stamp_ns: np.ndarray, arrival_ns: np.ndarray
) -> ClockEstimate:
    """Fit the lower envelope of arrival minus stamp by a line.

        maximise a subject to a + b (stamp_i - middle) <= arrival_i - stamp_i  for all i

    which is the edge of the lower convex hull above the middle. Standard errors: bootstrap over pieces of
    time.
    Source: Moon, Skelly and Towsley 1999 (linear programming estimate of clock skew), the hull form of the
    same program.

    Args:
        stamp_ns, arrival_ns: (N,) int64, N >= 1, any order.
    """
    middle = int(np.mean([stamp_ns.min(), stamp_ns.max()], dtype=np.longdouble))
    delay_ns = arrival_ns - stamp_ns
    base = int(delay_ns.min())  # epochs may differ by years: keep the digits
    x, d = (stamp_ns - middle) * 1e-9, (delay_ns - base) * 1e-9
    if len(x) < FEWEST or np.ptp(x) == 0:
        return ClockEstimate(clock, topics, base * 1e-9, np.nan, 0.0, np.nan, middle)
    plausible = _not_early(x, d)
    x, d = x[plausible], d[plausible]
    pieces = _lowest_points(x, d)
    offset, drift = _edge_at_middle(np.concatenate(pieces))
    spread = np.array([_edge_at_middle(sample) for sample in _resampled(pieces)])
    offset_std, drift_std = np.sqrt(np.mean((spread - [offset, drift]) ** 2, axis=0))
    offset_std *= np.sqrt(
        2
    )  # the smallest of n latencies lies above its limit by as much as it scatters
    grain = float(np.mean(d - offset - drift * x)) / len(
        x
    )  # of the envelope, for exponential latencies
    offset_std, drift_std = (
        max(offset_std, grain),
        max(drift_std, 4 * grain / np.ptp(x)),
    )  # resampling misses it
    return ClockEstimate(
        clock,
        topics,
        base * 1e-9 + offset,
        float(offset_std),
        drift * 1e6,
        float(drift_std) * 1e6,
        middle,
    )


def _not_early(x: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(N,) bool: all but single messages that are much earlier than any latency allows (wrong stamps).

    With q the 5 % quantile and m the median of the detrended delay, a one-sided distribution of latencies
    has nothing far below q; whatever is below q - 2 (m - q) is left out.
    """
    level = d - robust_line(x, d)
    low, middle = np.quantile(level, [0.05, 0.5])
    return np.asarray(level >= low - 2 * (middle - low))


def robust_line(x: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(N,) straight line through the 10 % quantiles of d in the first and the last third of x."""
    third, order = max(1, len(x) // 3), np.argsort(x, kind="stable")
    ends = order[:third], order[-third:]
    (x0, x1), (d0, d1) = ([np.median(x[e]) for e in ends], [np.quantile(d[e], 0.1) for e in ends])
    slope = (d1 - d0) / (x1 - x0) if x1 > x0 else 0.0
    return np.asarray(d0 + slope * (x - x0))


def _lowest_points(x: np.ndarray, d: np.ndarray) -> list[np.ndarray]:
    """Per piece of time the (k, 2) points that can lie on the envelope, with the overall trend taken off."""
    offset, drift = _edge_at_middle(np.column_stack([x, d]))
    above = d - offset - drift * x
    piece = np.minimum(((x - x.min()) / np.ptp(x) * BLOCKS).astype(int), BLOCKS - 1)
    order = np.lexsort([above, piece])
    rank = np.arange(len(x)) - np.searchsorted(piece[order], piece[order])
    kept = order[rank < LOWEST]
    return [
        np.column_stack([x[i], d[i]]) for p in np.unique(piece) for i in [kept[piece[kept] == p]]
    ]


def _resampled(pieces: list[np.ndarray]) -> list[np.ndarray]:
    """Bootstrap samples of the pieces, the same for every recording of that length."""
    rng = np.random.default_rng(0)
    draws = rng.integers(0, len(pieces), (RESAMPLES, len(pieces)))
    return [np.concatenate([pieces[i] for i in np.unique(draw)]) for draw in draws]


def _edge_at_middle(points: np.ndarray) -> tuple[float, float]:
    """Value and slope at x = 0 of the lower convex hull (monotone chain) of (k, 2) points."""
    hull: list[tuple[float, float]] = []
    for x, y in points[np.lexsort([points[:, 1], points[:, 0]])].tolist():
        if hull and hull[-1][0] == x:
            continue
        while len(hull) > 1 and _turns_right(hull[-2], hull[-1], (x, y)):
            hull.pop()
        hull.append((x, y))
    if len(hull) == 1:
        return hull[0][1], 0.0
    right = next((i for i, (x, _) in enumerate(hull) if x >= 0 and i), len(hull) - 1)
    (x0, y0), (x1, y1) = hull[right - 1], hull[right]
    slope = (y1 - y0) / (x1 - x0)
    return y0 - slope * x0, slope


def _turns_right(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """Whether b lies on or above the line from a to c."""
    return (b[0] - a[0]) * (c[1] - a[1]) <= (b[1] - a[1]) * (c[0] - a[0])


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
