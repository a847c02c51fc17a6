# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which of the heads in a picture is ours: motion in time of the own fish and of the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.heads import Head
from fish_vision.pose import HeadPose, wrap

Array = NDArray[Any]  # float64

VELOCITY_AGE = 0.12  # s between two poses that still give a velocity
PLACE_STD, TURN_STD = 0.003, 0.03  # m, rad, of a prediction over no time
SPEED_STD, YAW_RATE_STD = 0.5, 5.0  # m/s, rad/s, of a fish whose velocity is unknown
ACCELERATION_STD, YAW_ACCELERATION_STD = 5.0, 60.0  # m/s^2, rad/s^2, over a frame
TIME_MOST = 3.0  # s; after so long a fish may be anywhere


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
