# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner: a path, a speed and a robot's motion in; target point, wanted course, speed and turn, and
errors out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fish_control import scalar_math
from fish_control.line_of_sight import (
    GuidanceConfig,
    Motion,
    PathAhead,
    TrackingErrors,
    tracking_errors,
)
from fish_control.motion_observer import MotionObserver
from fish_control.path_batch import TrackerConfig
from fish_control.path_tracker import PathPoint, PathTracker
from fish_control.pool import stopping_side
from fish_control.reference_path import ReferencePath
from fish_control.stroke_mean import StrokeState, stroke_step

SLOWEST, FASTEST = 0.05, 0.5  # m/s, the range of speeds of the robot
# rad/s, wanted after the end; the rudder is hard over, so only its sign counts
GLIDING_YAW_RATE = 0.5


@dataclass(frozen=True)
class Plan:
    """What the robot should do now."""

    at: PathPoint
    errors: TrackingErrors
    speed: float  # m/s, wanted surge; 0 once the end of the path is passed
    yaw_rate: float  # rad/s, wanted: speed times the curvature of the path; after the end the side to turn to


class Planner:
    """Follows one path at one speed."""

    def __init__(
        self,
        path: ReferencePath,
        speed: float,
        tracker: TrackerConfig | None = None,
        guidance: GuidanceConfig | None = None,
    ) -> None:
        if not SLOWEST <= speed <= FASTEST:
            raise ValueError(f"speed is {speed!r} m/s, expected {SLOWEST} to {FASTEST}")
        self.path, self.speed = path, speed
        self.tracker = PathTracker(path, tracker)
        self.finished = False
        self._guidance = guidance or GuidanceConfig()
        self._observer = MotionObserver(
            StrokeState(),
            lambda stroke, motion, dt: stroke_step(stroke, motion.yaw_rate, motion.sway, dt),
        )
        self._side = 0.0  # +1 left, -1 right, chosen when the end is passed

    def start_nearest(self, x: float, y: float) -> None:
        """Begin at the point of the path nearest to (x, y) [m] instead of at its beginning."""
        self.tracker.reset(self.tracker.nearest([x, y]))

    def resume(self, x: float, y: float, progress: float, travelled: float) -> bool:
        """Go on after an interruption at `progress` [m] during which at most `travelled` [m] were swum.

        The nearest point from there on is taken, so that no part is swum twice and none before it; False, and
        nothing changed, if the robot is not within that distance of the path.
        """
        s = progress + np.arange(0.0, travelled + self.path.spacing, self.path.spacing)
        if not self.path.closed:
            s = s[s <= self.path.length]
        if len(s) == 0:
            return False
        distance = np.linalg.norm(self.path.point(s) - [x, y], axis=1)
        if distance.min() > travelled:
            return False
        self.tracker.reset(float(s[np.argmin(distance)]))
        return True

    def observe(self, time: float, motion: Motion) -> None:
        """Take in odometry stamped `time` [s]; call it with every message."""
        self._observer.add(time, motion)

    def plan(self, motion: Motion) -> Plan:
        """Advance along the path and say what to do."""
        at = self.tracker.update([motion.x, motion.y])
        self.finished = self.finished or at.finished
        speed = 0.0 if self.finished else self.speed
        ahead = PathAhead(
            at.x, at.y, at.heading, at.curvature, at.target[0], at.target[1], at.chord
        )
        errors = TrackingErrors(
            *map(
                float,
                tracking_errors(
                    self._observer.state, motion, ahead, speed, self._guidance, scalar_math
                ),
            )
        )
        if self.finished:
            return Plan(at, errors, 0.0, self._stopping_yaw_rate(motion))
        return Plan(at, errors, self.speed, self.speed * at.curvature)

    def _stopping_yaw_rate(self, motion: Motion) -> float:
        """Yaw rate [rad/s] while the fish glides after the end: to the side with more room, chosen once."""
        if self._side == 0.0:
            self._side = stopping_side(motion.x, motion.y, motion.heading)
        return self._side * GLIDING_YAW_RATE


def motion_is_finite(motion: Motion) -> bool:
    """Whether every value is a number."""
    return all(map(math.isfinite, motion))
