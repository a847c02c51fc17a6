# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When a run must end before its own end: the fish is out of the pool, the camera is silent, the time is up. No ROS, no clock.

All times are stamps of the robot: in simulation the simulator's, so that a slow computer ends no run.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fish_control.pool import HALF_LENGTH, HALF_WIDTH, wall_distance

EDGE = 0.01  # m, nearer to a wall the head's centre is at it: its hull touches earlier, the camera errs by 2 to 3 mm
LONGEST_AT_EDGE = 1.0  # s that the fish may be at a wall or beyond; one wrong pose is no reason
LONGEST_WITHOUT_CAMERA = 30.0  # s without a pose of the camera, although fusion goes on


@dataclass(frozen=True)
class Seen:
    """A pose of the camera."""

    stamp: float  # s, of the exposure
    x: float  # m, pool frame
    y: float  # m


class RunWatch:
    """Follows one run by the robot's clock from `begin` [s]; `limit`: s that it may last."""

    def __init__(self, begin: float, limit: float = np.inf) -> None:
        self._begin, self._limit = begin, limit
        self._seen: Seen | None = None
        self._outside_since: float | None = None

    def reason_to_end(self, now: float, seen: Seen | None) -> str | None:
        """Why the run must end at `now` [s] with the newest pose of the camera; None where it may go on.

        Poses older than the newest one are left out, and so are poses that are no numbers.
        """
        if (
            seen is not None
            and np.isfinite([seen.x, seen.y]).all()
            and (self._seen is None or seen.stamp > self._seen.stamp)
        ):
            self._take(seen)
        return self._outside() or self._blind(now) or self._late(now)

    def _take(self, seen: Seen) -> None:
        self._seen = seen
        if wall_distance(np.array([[seen.x, seen.y]])) > EDGE:
            self._outside_since = None
        elif self._outside_since is None:
            self._outside_since = seen.stamp

    def _outside(self) -> str | None:
        seen, since = self._seen, self._outside_since
        if seen is None or since is None or seen.stamp - since < LONGEST_AT_EDGE:
            return None
        return (
            f"the fish left the pool: the camera has seen it at a wall or beyond for {LONGEST_AT_EDGE:g} s, now at "
            f"({seen.x:.2f}, {seen.y:.2f}) m; the walls are at x = +-{HALF_LENGTH:g} m and y = +-{HALF_WIDTH:g} m"
        )

    def _blind(self, now: float) -> str | None:
        last = self._begin if self._seen is None else max(self._seen.stamp, self._begin)
        if now - last <= LONGEST_WITHOUT_CAMERA:
            return None
        return (
            f"no camera/pose for {LONGEST_WITHOUT_CAMERA:g} s: camera or tracker hangs, or the camera does not see the fish; "
            "see their logs"
        )

    def _late(self, now: float) -> str | None:
        if now - self._begin <= self._limit:
            return None
        return f"the run is not over after {self._limit:g} s"
