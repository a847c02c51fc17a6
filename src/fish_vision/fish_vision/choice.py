# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which head is the own fish: the likeliest one, or none where another could be it as well."""

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum
from math import hypot, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.calibration import POOL
from fish_vision.config import TrackerConfig
from fish_vision.heads import Head, Track, alike, assign
from fish_vision.pose import HeadPose, wrap

Array = NDArray[Any]  # float64

JUMP_DISTANCE = 0.03  # m, never counted as a jump
JUMP_TURN = 0.3  # rad, never counted as a jump
FAR, TURNED = 0.020, radians(10.0)  # two poses that differ less are no rivals
MARGIN = 9.0  # by how much the own fish must be likelier (twice the logarithm) than another
SURPRISE = 60.0  # cost of a pose that is believed only with the tail behind it
RIVALS_MOST = 12
MIRRORED, MIRRORED_TURN = 0.06, 0.5  # m, rad, misfit of a mirror image


class Reason(Enum):
    """Why an image gave no pose."""

    NO_FRONT = "no front marker"
    NO_REAR = "no rear marker"
    NO_PAIR = "front and rear marker not the right distance apart"
    NO_TAIL = "no tail marker behind the head: front and rear could be swapped"
    SWAPPED = "tail markers ahead of the head: markers or colours swapped"
    FOREIGN = "tail colours in another order: another fish"
    OUTSIDE = "pose outside the pool"
    JUMP = "jump: too far from the last pose"
    AMBIGUOUS = "more than one fish has these markers"
    MIRRORED = "only the mirror image in a wall is seen"
    NO_TAG = "no tag of the head"
    REPEATED = "the same image as before: the camera is frozen, or sends every image twice"
    TAG_SIZE = "tag of the head not of its size"


class Choice:
    """Remembers the own fish and the others, and says which head is the own one.

    At first a head is ours if a tail marker stands behind it and no other head has one. Then motion decides: a
    head is ours if the own fish can have got there and no other fish is as likely to be it. Heads seen while the
    own fish was elsewhere are other fish, for `rival_memory_s` after they were last seen.
    """

    def __init__(self, config: TrackerConfig) -> None:
        self._config = config
        self._own: Track | None = None
        self._rivals: list[Track] = []

    def last(self, stamp: float) -> HeadPose | None:
        """The own fish's last pose while it tells where to look; a stamp that goes back starts again."""
        if self._own is not None and stamp < self._own.stamp:
            self._own, self._rivals = None, []
        if self._own is None or stamp - self._own.stamp > self._config.reacquire_s:
            return None
        return self._own.pose

    def near(self, heads: Sequence[Head], stamp: float, nothing: Reason) -> Head | Reason:
        """The own head among those near its last pose, or the reason if there is none.

        Args:
            heads: every head that is seen there.
            nothing: reason if there is none.
        """
        able, reason = self._able(heads, nothing)
        own = self._followed(able, stamp, reason)
        if isinstance(own, Head):
            self._believe(own, able, stamp)
        return own

    def anywhere(self, heads: Sequence[Head], stamp: float, nothing: Reason) -> Head | Reason:
        """The own head among all of the picture, or the reason if there is none."""
        memory = self._config.rival_memory_s
        if self._own is not None and stamp < self._own.stamp:
            self._own, self._rivals = None, []
        self._rivals = [rival for rival in self._rivals if stamp - rival.stamp <= memory]
        able, reason = self._able(heads, nothing)
        if self._own is None:
            own = self._first(able, stamp, reason)
        else:
            if stamp - self._own.stamp > memory:  # a fish that was elsewhere so long may be ours
                self._rivals = []
            own = self._followed(able, stamp, reason)
        if isinstance(own, Head):
            self._believe(own, able, stamp)
        elif self._own is not None and stamp > self._own.stamp:
            self._remember(able, stamp)
        return own

    def others(self, heads: Sequence[Head], stamp: float) -> None:
        """Heads that are seen elsewhere while the own fish is in view are other fish."""
        self._remember(self._able(heads, Reason.NO_PAIR)[0], stamp)

    def _able(self, heads: Sequence[Head], reason: Reason) -> tuple[list[Head], Reason]:
        """Heads that can be a fish of ours in this pool, and the reason why the others are not."""
        result = []
        for head in heads:
            if not in_pool(head.pose, self._config.pool_margin):
                reason = Reason.OUTSIDE
            elif head.swapped:
                reason = Reason.SWAPPED
            elif head.foreign:
                reason = Reason.FOREIGN
            else:
                result.append(head)
        return [a for a in result if not any(_mirror_image(a.pose, b.pose) for b in result)], reason

    def _first(self, heads: Sequence[Head], stamp: float, reason: Reason) -> Head | Reason:
        """The one head with the tail's evidence, when nothing is known of before.

        Two of them are both remembered: neither is ours until the other is out of sight for `rival_memory_s`.
        """
        if not heads:
            return reason
        proven = [h for h in heads if h.behind or not self._config.tail_links]
        if not proven:
            return Reason.NO_TAIL
        distinct: list[Head] = []
        for head in sorted(proven, key=lambda h: (-len(h.tail), abs(h.misfit))):
            if not any(
                head.shares_a_marker(h) or alike(head.pose, h.pose, FAR, TURNED) for h in distinct
            ):
                distinct.append(head)
        self._remember(distinct, stamp)
        if len(self._rivals) > 1:
            return Reason.AMBIGUOUS
        self._rivals = []
        return distinct[0]

    def _followed(self, heads: Sequence[Head], stamp: float, reason: Reason) -> Head | Reason:
        """The head that continues the own fish's motion."""
        if not heads:
            return reason
        assert self._own is not None
        real = [head for head in heads if not _reflected(head.pose, self._own, stamp)]
        if not real:
            return Reason.MIRRORED
        heads, tracks = real, [self._own, *self._rivals]
        allowed = np.array(
            [[reaches(t, h.pose, stamp, self._config) for h in heads] for t in tracks]
        )
        given = assign(tracks, heads, stamp, allowed)
        if 0 not in given:
            return Reason.AMBIGUOUS if allowed[0].any() else Reason.JUMP
        own = heads[given[0]]
        cost = self._own.cost(own.pose, stamp)
        if cost > SURPRISE and not own.behind and self._config.tail_links:
            return Reason.JUMP
        if stamp - self._own.stamp > self._config.reacquire_s and not own.behind:
            if self._config.tail_links:
                return Reason.NO_TAIL
        free = [i for i in range(1, len(tracks)) if i not in given and allowed[i, given[0]]]
        if any(tracks[i].cost(own.pose, stamp) < cost + MARGIN for i in free):
            return Reason.AMBIGUOUS
        rest = set(range(len(heads))) - set(given.values())
        for j in rest:
            other = heads[j]
            if not allowed[0, j] or alike(own.pose, other.pose, FAR, TURNED):
                continue
            if own.shares_a_marker(other) and len(own.tail) > len(other.tail):
                continue
            if self._own.cost(other.pose, stamp) < cost + MARGIN:
                return Reason.AMBIGUOUS
        return own

    def _believe(self, own: Head, heads: Sequence[Head], stamp: float) -> None:
        self._own = (
            Track(own.pose, stamp) if self._own is None else self._own.after(own.pose, stamp)
        )
        self._remember([h for h in heads if h is not own and not h.shares_a_marker(own)], stamp)

    def _remember(self, heads: Sequence[Head], stamp: float) -> None:
        """Take over where the other fish are; a head where none was is one more."""
        if not heads:
            return
        allowed = np.array(
            [[reaches(t, h.pose, stamp, self._config) for h in heads] for t in self._rivals]
        )
        given = assign(self._rivals, heads, stamp, allowed) if self._rivals else {}
        rivals = list(self._rivals)
        for i, j in given.items():
            rivals[i] = rivals[i].after(heads[j].pose, stamp)
        taken = [heads[j] for j in given.values()]
        for j, head in enumerate(heads):
            if j in given.values() or any(head.shares_a_marker(other) for other in taken):
                continue
            reachable = (
                self._own is not None
                and self._own.stamp < stamp
                and reaches(self._own, head.pose, stamp, self._config)
            )
            if not reachable:  # else it may be ours
                rivals.append(Track(head.pose, stamp))
                taken.append(head)
        self._rivals = sorted(rivals, key=lambda rival: -rival.stamp)[:RIVALS_MOST]


def reaches(track: Track, pose: HeadPose, stamp: float, config: TrackerConfig) -> bool:
    """Whether a fish can have got from a track's end to a pose."""
    dt = stamp - track.stamp
    if dt > config.reacquire_s:
        return True
    far = hypot(pose.x - track.pose.x, pose.y - track.pose.y)
    turn = abs(wrap(pose.heading - track.pose.heading))
    return (
        far <= config.max_speed * dt + JUMP_DISTANCE
        and turn <= config.max_yaw_rate * dt + JUMP_TURN
    )


def in_pool(pose: HeadPose, margin: float) -> bool:
    """Whether a pose is in the pool, or at most margin (m) outside its walls."""
    return abs(pose.x) <= POOL[0] / 2 + margin and abs(pose.y) <= POOL[1] / 2 + margin


def _reflected(pose: HeadPose, track: Track, stamp: float) -> bool:
    """Whether a pose beyond a wall is the wall's image of a fish that continues a track better."""
    for axis, side in enumerate(POOL):
        place = (pose.x, pose.y)[axis]
        if abs(place) <= side / 2:
            continue
        back = float(np.copysign(side, place)) - place
        if axis == 0:
            real = replace(pose, x=back, heading=wrap(np.pi - pose.heading))
        else:
            real = replace(pose, y=back, heading=-pose.heading)
        if track.cost(real, stamp) < track.cost(pose, stamp):
            return True
    return False


def _mirror_image(pose: HeadPose, other: HeadPose) -> bool:
    """Whether a pose outside a wall, or as near to it, is what the wall shows of the other one."""
    for axis, side in enumerate(POOL):
        place, real = (pose.x, pose.y)[axis], (other.x, other.y)[axis]
        wall = float(np.copysign(side / 2, place))
        mirrored = (2 * wall - other.x, other.y) if axis == 0 else (other.x, 2 * wall - other.y)
        heading = np.pi - other.heading if axis == 0 else -other.heading
        if (
            abs(place) > abs(real)
            and hypot(pose.x - mirrored[0], pose.y - mirrored[1]) < MIRRORED
            and abs(wrap(pose.heading - float(heading))) < MIRRORED_TURN
        ):
            return True
    return False
