# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far the camera's stamps are from the IMU's clock, found from the heading that both measure.

An image stamped t was taken at t + offset of the IMU's clock. For each offset of a grid the change of the camera's heading
over LAG is compared with that of the IMU's heading; the offset with the smallest sum of squares is the estimate:

    S(o) = sum over k of exp(-age_k / memory) (psi_k - psi_j - Y(t_k + o) + Y(t_j + o))^2,   t_k - t_j about LAG

with the sums of `offset_sums`, over the pairs k of which the IMU measured all from t_j + o to t_k + o: neither before its
first sample nor in a gap. The swing of the head repeats itself once a stroke, so the estimate counts only where every other
offset fits worse; of one that too few pairs tell of, only what was known beforehand can say so. An image cannot be taken
after it arrives: this bounds the grid, however far the clocks are apart. The IMU's newest sample tells the time of arrival;
where it comes later than the image, the bound moves by as much.

Where the time from stamp to arrival steps, a clock was set by as much, or the images come later with stamps as good as
before. Stamps that go back by as much say that it was the clock, as images that come later are still in order. Else the
headings tell the two apart within some poses; until then the offset is undecided. After a clock was set back the samples of
before are of no use, but the offset found with them is, moved by the step of the latency.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fish_control.imu_history import ImuHistory
from fish_control.latency import LEAST_STEP, LatencyWatch
from fish_control.offset_sums import (
    CLEAR,
    CLIP,
    LAG,
    STEP,
    ClockEstimate,
    Mask,
    OffsetSums,
)

Array = NDArray[np.float64]

LONGEST_PAIR = 0.4  # s
OLDEST = 1.7  # s, largest age of an image at its arrival
AHEAD = 0.1  # s, by which an image may seem to be taken after its arrival
LATE_IMU = 0.4  # s, the same where the offset known beforehand says so: the IMU comes later than the camera
# s of the IMU's samples that poses are compared with, the next of which brings the comparison about
LOOKS_BACK = OLDEST + AHEAD + LATE_IMU + LONGEST_PAIR
MEMORY = 20.0  # s, of the estimate
SHORT_MEMORY = 4.0  # s, of the one that notices changes
REFINED = 0.005  # s, smaller changes are left to the long memory
CLOCK_DRIFT = 1e-4  # s per s, of two clocks while nobody compares them
STEP_STD = 0.02  # s, of the step of a clock as the latency shows it
CHOICE_PAIRS = 6.0  # after a step before one of two offsets is chosen
LONGEST_DOUBT = 3.0  # s, after which the offset is looked for as if nothing were known


class _Seen(NamedTuple):
    """A pose, and what the IMU says of its moment for each offset."""

    stamp: float  # s
    heading: float  # rad
    turned: Array  # (G,) heading of the IMU [rad]
    gaps: Array  # (G,) gaps of the IMU before


class CameraClock:
    """Feed it every pose when it arrives; ask for the offset.

    Attributes:
        jumps: how often one of the clocks was set.
    """

    def __init__(self, offset: float, std: float, latency: float | None = None) -> None:
        """offset, std: what is known beforehand [s]; latency: from stamp to arrival when it was found, if it was [s]."""
        self._given = self._prior = ClockEstimate(offset, std, False)
        self._given_latency = latency
        self._watch = LatencyWatch()
        self._grid: Array | None = None  # (G,) offsets [s]
        self._ahead = AHEAD  # s, by which the grid goes beyond the arrival
        self.jumps = 0
        self.current = self._prior
        self.contradicted = False
        self._newest = -math.inf  # s, stamp of the newest pair
        self._waiting: deque[tuple[float, float, float]] = deque()  # arrival, stamp, heading
        # stamp and value of the newest sure one
        self._sure: tuple[float, ClockEstimate] | None = None
        self._rivals: tuple[
            ClockEstimate, ...
        ] = ()  # after a step: as before, moved with the clock
        self._stepped_at = 0.0  # s, stamp
        self._last_stamp, self._back = -math.inf, 0.0  # s; by how much stamps went back
        self._back_at, self._disordered = (
            0.0,
            False,
        )  # s, when they did; whether it may be a set clock

    def anew(self) -> CameraClock:
        """One for the time after a clock was set back, which knows what was known before."""
        if self.current.sure:
            return CameraClock(self.current.offset, self._given.std, self._watch.usual)
        return CameraClock(self._given.offset, self._given.std, self._given_latency)

    @property
    def age(self) -> float:
        """Median age of an image at its arrival [s], NaN before the first."""
        usual = self._watch.usual
        return math.nan if usual is None else usual - self.current.offset

    @property
    def undecided(self) -> bool:
        """Whether a clock may have been set: poses that show a moving fish wait until it is clear."""
        return bool(self._rivals) or self._disordered

    def add(self, stamp: float, heading: float, imu: ImuHistory, now: float) -> None:
        """A pose with this stamp and heading arrives when the IMU's clock is at `now` [s].

        It is compared once the IMU has told all that the grid asks for.
        """
        usual = self._watch.usual
        stepped = self._watch.add(now - stamp)
        back = max(self._back, self._last_stamp - stamp)
        if self._back <= LEAST_STEP:
            self._back_at = now
        self._back = back if usual is None or self._watch.strange else 0.0
        # a network that mixes up images for longer sets no clock
        recent = now - self._back_at <= LONGEST_DOUBT
        self._disordered = self._back > LEAST_STEP and recent
        self._last_stamp = stamp
        if stepped is not None and usual is not None:
            self._step(stamp, stepped, usual, back)
        elif self._grid is None and self._watch.usual is not None:
            self._begin(self._watch.usual)
        self._waiting.append((now, stamp, heading))
        while self._waiting and self._is_told(now, *self._waiting[0][:2]):
            self._compare(*self._waiting.popleft()[1:], imu)

    def _is_told(self, now: float, arrival: float, stamp: float) -> bool:
        """Whether the IMU has said all that the grid asks for, or would have long ago if the stamp were right."""
        if self._grid is None:
            return False
        return now >= min(stamp + float(self._grid[-1]), arrival + self._ahead + LEAST_STEP)

    def _compare(self, stamp: float, heading: float, imu: ImuHistory) -> None:
        assert self._grid is not None
        times = stamp + self._grid
        seen = _Seen(stamp, heading, imu.heading(times), imu.gaps(times))
        while self._poses and stamp - self._poses[0].stamp > LONGEST_PAIR:
            self._poses.popleft()
        before = next((p for p in reversed(self._poses) if stamp - p.stamp >= LAG - 1e-3), None)
        self._poses.append(seen)
        if before is None:
            return
        change = heading - before.heading - (seen.turned - before.turned)
        change = np.abs((change + math.pi) % (2.0 * math.pi) - math.pi)
        squares = np.minimum(change, CLIP) ** 2
        for sums in (self._long, self._short):
            sums.add(squares, stamp - self._newest, seen.gaps == before.gaps)
        self._newest = stamp
        self._decide(stamp)

    def _begin(self, latency: float) -> None:
        """Where the latency is not what it was when the offset was found, a clock was set since."""
        before = latency if self._given_latency is None else self._given_latency
        if abs(latency - before) > LEAST_STEP:
            offset, std = self._given.offset + latency - before, max(self._given.std, STEP_STD)
            self._prior = self.current = ClockEstimate(offset, std, False)
        self._place_grid(latency, self._prior.offset)

    def _step(self, stamp: float, latency: float, usual: float, back: float) -> None:
        """The latency has changed from `usual` [s], and stamps went back by `back` [s] meanwhile."""
        held = self._rivals[0] if self._rivals else self.current
        moved = ClockEstimate(held.offset + latency - usual, STEP_STD, False)
        in_order = back < 0.5 * abs(latency - usual)
        images_late = in_order and -LATE_IMU <= latency - held.offset <= OLDEST
        self._prior = held if images_late else moved
        self._place_grid(latency, max(held.offset, moved.offset))
        self._rivals, self._stepped_at = (held, moved), stamp
        if not images_late:
            self._settle(moved)

    def _settle(self, chosen: ClockEstimate) -> None:
        """End the doubt."""
        if chosen is not self._rivals[0]:
            self.jumps += 1
            self._sure = None
        self._prior = self.current = chosen
        self._rivals = ()

    def _choose(self, stamp: float) -> None:
        """Let the headings since the step say which offset is right; at rest they do not."""
        assert self._grid is not None
        held, moved = self._rivals
        for chosen, other in ((held, moved), (moved, held)):
            if self._excludes(chosen, other):
                self._settle(chosen)
                return
        if stamp - self._stepped_at > LONGEST_DOUBT:
            doubt = abs(moved.offset - held.offset)
            self._settle(ClockEstimate(held.offset, doubt, False))

    def _excludes(self, chosen: ClockEstimate, other: ClockEstimate) -> bool:
        """Whether one offset fits enough pairs so well that another one is out of the question."""
        assert self._grid is not None
        near, far = (np.abs(self._grid - e.offset) <= 1.5 * STEP for e in (chosen, other))
        near &= self._long.known(CHOICE_PAIRS)
        if not near.any():
            return False
        likelihood = self._long.log_likelihood(self._long.best(near))
        return float(likelihood.max(where=far, initial=-math.inf)) < -CLEAR

    def _place_grid(self, latency: float, largest: float) -> None:
        """largest: of the offsets that may be right [s]."""
        self._ahead = AHEAD + min(max(largest - latency, 0.0), LATE_IMU)
        first = math.floor((latency - OLDEST) / STEP) * STEP
        steps = np.arange(round((OLDEST + self._ahead) / STEP) + 1, dtype=np.float64)
        grid: Array = first + STEP * steps
        self._grid = grid
        self._long, self._short = OffsetSums(MEMORY, len(grid)), OffsetSums(SHORT_MEMORY, len(grid))
        self._poses: deque[_Seen] = deque()
        self._waiting.clear()
        self._newest = -math.inf
        age = latency - self._prior.offset
        if not -LATE_IMU <= age <= OLDEST:  # the clocks are farther apart than anybody said
            self._prior = ClockEstimate(latency - 0.1, 0.5, False)
            self.current = self._prior
            self.contradicted = True

    def _decide(self, stamp: float) -> None:
        assert self._grid is not None
        if self._rivals:
            self._choose(stamp)
            return
        found = self._long.estimate(self._grid, expected=self._prior)
        if self._sure is not None:
            held = self.current
            recent = self._short.estimate(self._grid, held.offset)
            apart = abs(recent.offset - held.offset)
            if recent.sure and apart > max(4.0 * math.hypot(recent.std, held.std), REFINED):
                self._long = OffsetSums(MEMORY, len(self._grid))  # what it remembers is over
                found = recent
        if found.sure:
            self.current, self._sure, self.contradicted = found, (stamp, found), False
        elif self._sure is not None:
            since, held = stamp - self._sure[0], self._sure[1]
            std = math.hypot(held.std, CLOCK_DRIFT * since)
            self.current = ClockEstimate(held.offset, std, True)
        else:
            self._weigh_prior()

    def _weigh_prior(self) -> None:
        """Where the data contradict what was known beforehand, take the nearest offset that they allow.

        Of a few pairs the best offset fits too well to contradict any other.
        """
        assert self._grid is not None
        self.current, known = self._prior, self._long.known()
        if not known.any():
            return
        likelihood = self._long.log_likelihood(self._long.best(known))
        near = self._prior.agrees(self._grid)
        self.contradicted = bool(not near.any() or likelihood[near].max() < -CLEAR)
        if self.contradicted:
            likelihood[~known] = -math.inf
            allowed = self._grid[(likelihood > -CLEAR) & _is_peak(likelihood)]
            nearest = allowed[np.abs(allowed - self._prior.offset).argmin()]
            spread = math.sqrt(np.mean(np.square(allowed - nearest)))
            std = max(self._prior.std, 2.0 * STEP, spread)
            self.current = ClockEstimate(float(nearest), std, False)


def _is_peak(values: Array) -> Mask:
    """Which are no smaller than their neighbours."""
    padded = np.concatenate(([-np.inf], values, [-np.inf]))
    peak: Mask = (values >= padded[:-2]) & (values >= padded[2:])
    return peak
