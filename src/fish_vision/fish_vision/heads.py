# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every head that the spots in a picture may be: pairs at the right distance, judged with the tail behind them; and the motion in
time of the own fish and of the others, which says which head is whose.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.config import TrackerConfig
from fish_vision.pose import HeadPose, MarkerLayout, Spot, head_pose, tail_angles, tail_sides, wrap

Array = NDArray[Any]  # float64

MISFIT_MOST = 0.15  # share of the spacing beyond which two spots are no pair, however uncertain
MOST = 12  # pairs that are considered, best first
SIGMAS = 4.0  # standard deviations of the measured distance that a pair may be off
UNCERTAIN_MOST = 0.01  # share of the spacing that they add at most, or a wrong focal length would pass for hidden parts

VELOCITY_AGE = 0.12  # s between two poses that still give a velocity
PLACE_STD, TURN_STD = 0.003, 0.03  # m, rad, of a prediction over no time
SPEED_STD, YAW_RATE_STD = 0.5, 5.0  # m/s, rad/s, of a fish whose velocity is unknown
ACCELERATION_STD, YAW_ACCELERATION_STD = 5.0, 60.0  # m/s^2, rad/s^2, over a frame
TIME_MOST = 3.0  # s; after so long a fish may be anywhere


@dataclass(frozen=True)
class Head:
    """One pair of spots as a head, with what the tail's spots say of it."""

    pose: HeadPose
    front: Spot
    rear: Spot
    spacing: float  # measured distance of the markers over the true one
    misfit: float  # of the distance, standard deviations
    tail: tuple[float, ...]  # angles of the links seen, from the head backwards, rad
    behind: int  # tail spots where the tail is
    ahead: int  # tail spots where it is of a head turned round
    foreign: bool  # a tail whose colours come in another order

    @property
    def swapped(self) -> bool:
        """Whether the tail is ahead: front and rear are mistaken for each other."""
        return self.ahead > self.behind

    def shares_a_marker(self, other: "Head") -> bool:
        """Whether a spot of this head is one of the other's."""
        return self.front is other.front or self.rear is other.rear


def pairs(
    front: Sequence[Spot], rear: Sequence[Spot], layout: MarkerLayout, tolerance: float
) -> tuple[list[tuple[int, int]], float | None]:
    """Pairs (front, rear) whose distance fits, best first, and the distance nearest to the true one (share).

    | |p_f - p_r| / spacing - 1 | <= tolerance + SIGMAS std / spacing, at most MISFIT_MOST
    """
    if not front or not rear:
        return [], None
    f, r = np.array([s.position for s in front]), np.array([s.position for s in rear])
    line = f[:, None] - r
    distance = np.hypot(line[..., 0], line[..., 1])
    shares = distance / layout.spacing - 1.0
    i, j = np.nonzero(np.abs(shares) <= MISFIT_MOST)
    result = []
    for a, b in zip(i.tolist(), j.tolist(), strict=True):
        along = line[a, b] / distance[a, b]
        variance = float(along @ (front[a].covariance + rear[b].covariance) @ along)
        uncertain = min(SIGMAS * variance**0.5 / layout.spacing, UNCERTAIN_MOST)
        if abs(shares[a, b]) <= tolerance + uncertain:
            result.append((abs(float(shares[a, b])), a, b))
    nearest = float(shares.flat[np.argmin(np.abs(shares))])
    return [(a, b) for _, a, b in sorted(result)[:MOST]], nearest


class HeadFinder:
    """Makes heads of spots."""

    def __init__(self, config: TrackerConfig) -> None:
        self._config, self.layout = config, config.layout()
        self._reach = config.tail_links * self.layout.link_length + config.tail_tolerance

    def pairs(
        self, front: Sequence[Spot], rear: Sequence[Spot]
    ) -> tuple[list[tuple[int, int]], float | None]:
        """See `pairs`, with the parameters' tolerance."""
        return pairs(front, rear, self.layout, self._config.spacing_tolerance)

    def heads(
        self, front: Sequence[Spot], rear: Sequence[Spot], tail: Sequence[Sequence[Spot]]
    ) -> tuple[list[Head], float | None]:
        """All heads that the spots may be, and the misfit of the pair that fits best (share).

        Args:
            front: spots of the front marker's colour.
            rear: spots of the rear marker's colour.
            tail: spots of the odd and of the even links' colours; empty without tail markers.
        """
        found, nearest = self.pairs(front, rear)
        return [self._head(front[i], rear[j], tail) for i, j in found], nearest

    def _head(self, front: Spot, rear: Spot, tail: Sequence[Sequence[Spot]]) -> Head:
        config, layout = self._config, self.layout
        pose = head_pose(front, rear, layout)
        line = front.position - rear.position
        distance = hypot(*line)
        along = line / distance
        std = float(along @ (front.covariance + rear.covariance) @ along) ** 0.5
        misfit = (distance - layout.spacing) / (std + config.spacing_tolerance * layout.spacing / 3)
        angles: tuple[float, ...] = ()
        behind = ahead = 0
        foreign = False
        if tail:
            tail = [[s for s in spots if self._apart(s, front, rear)] for spots in tail]
            links = [tail[i % 2] for i in range(config.tail_links)]
            angles = tail_angles(pose, links, layout, config.tail_tolerance)
            every = [spot for spots in tail for spot in spots]
            behind, ahead = tail_sides(pose, every, layout, self._reach)
            if not angles and behind:
                other = [tail[(i + 1) % 2] for i in range(config.tail_links)]
                foreign = len(tail_angles(pose, other, layout, config.tail_tolerance)) > 1
        return Head(
            pose, front, rear, distance / layout.spacing, misfit, angles, behind, ahead, foreign
        )

    def _apart(self, spot: Spot, front: Spot, rear: Spot) -> bool:
        """Whether a spot of a tail colour is no part of the head's markers: their edges show every hue in some light."""
        return all(
            hypot(*(spot.position - other.position)) > self._config.marker_diameter / 2
            for other in (front, rear)
        )


@dataclass(frozen=True)
class Track:
    """Where a fish was last, and how it moved (m/s, m/s, rad/s) if two poses soon after each other say so."""

    pose: HeadPose
    stamp: float
    velocity: tuple[float, float, float] | None = None

    def after(self, pose: HeadPose, stamp: float) -> "Track":
        """The track with one more pose."""
        dt = stamp - self.stamp
        if not 0.0 < dt <= VELOCITY_AGE:
            return Track(pose, stamp)
        turn = wrap(pose.heading - self.pose.heading)
        rates = (pose.x - self.pose.x) / dt, (pose.y - self.pose.y) / dt, turn / dt
        return Track(pose, stamp, rates)

    def cost(self, pose: HeadPose, stamp: float) -> float:
        """Twice the negative logarithm of the likelihood of a pose, up to a constant.

            d^2 / s_p^2 + turn^2 / s_h^2 + 4 ln s_p + 2 ln s_h,  relative to a prediction over no time

        d, turn: from the pose predicted with the last velocity. s_p, s_h grow with the time since.
        """
        dt = min(max(stamp - self.stamp, 0.0), TIME_MOST)
        x, y, heading = self.pose.x, self.pose.y, self.pose.heading
        s_p, s_h = PLACE_STD + SPEED_STD * dt, TURN_STD + YAW_RATE_STD * dt
        if self.velocity is not None and dt <= VELOCITY_AGE:
            v = self.velocity
            x, y, heading = x + v[0] * dt, y + v[1] * dt, heading + v[2] * dt
            s_p = min(s_p, PLACE_STD + ACCELERATION_STD * dt**2)
            s_h = min(s_h, TURN_STD + YAW_ACCELERATION_STD * dt**2)
        d, turn = hypot(pose.x - x, pose.y - y), wrap(pose.heading - heading)
        spread = 4.0 * log(s_p / PLACE_STD) + 2.0 * log(s_h / TURN_STD)
        return (d / s_p) ** 2 + (turn / s_h) ** 2 + spread


def assign(
    tracks: Sequence[Track], heads: Sequence[Head], stamp: float, allowed: Array
) -> dict[int, int]:
    """Track -> head, the likeliest pairs first; a head that shares a marker with one given away falls out.

    Args:
        allowed: (tracks, heads) whether the track's fish can have got to the head's pose.
    """
    costs = sorted(
        (track.cost(head.pose, stamp), i, j)
        for i, track in enumerate(tracks)
        for j, head in enumerate(heads)
        if allowed[i, j]
    )
    given: dict[int, int] = {}
    for _, i, j in costs:
        clash = any(
            j == other or heads[j].shares_a_marker(heads[other]) for other in given.values()
        )
        if i not in given and not clash:
            given[i] = j
    return given


def alike(a: HeadPose, b: HeadPose, far: float, turned: float) -> bool:
    """Whether two poses are as good as one: less than far (m) and turned (rad) apart."""
    near: bool = np.hypot(a.x - b.x, a.y - b.y) < far
    return near and abs(wrap(a.heading - b.heading)) < turned
