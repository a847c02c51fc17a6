# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner: a path, a speed and a robot's motion in; target point, wanted course, speed and turn, and errors out.

Its progress is kept on disk, so that a planner that was killed goes on where it was. Odometry alone cannot say where on a
self-crossing path the robot is, and topics of a killed publisher are gone. The file is removed when the planner ends as it
should, and when a path is sent again that was swum to its end. After an error it stays: whoever starts the planner again
wants it to go on.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fish_control import scalar_math
from fish_control.line_of_sight import (
    GuidanceConfig,
    Motion,
    MotionObserver,
    PathAhead,
    TrackingErrors,
    tracking_errors,
)
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


SAVE_PERIOD = 0.2  # s between writes


def path_digest(path: ReferencePath) -> str:
    """Same for the same points, to a millimetre, and the same end."""
    content = (path.points * 1000.0).round().astype(
        "int64"
    ).tobytes() + f"{path.closed} {path.end}".encode()
    return hashlib.sha256(content).hexdigest()[:16]


class ProgressFile:
    """Keeps the progress along one path at a time.

    A thread of its own writes, because a write to a busy disk can take half a second.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._next_save = -math.inf
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="progress")
        self._writing: Future[None] | None = None
        self._forgotten = False  # though the file may still be there
        self.problem = ""  # why it could not be written, if so

    def recall(self, digest: str, time: float, oldest: float) -> tuple[float, float] | None:
        """(progress [m], age [s]) that was kept for this path within `oldest` [s] before `time` [s].

        None if there is none: no file, a damaged one, another path, too old, or from a clock that was ahead.
        """
        if self._forgotten:
            return None
        try:
            data = json.loads(self._file.read_text(encoding="utf-8"))
            known, kept, progress = str(data["path"]), float(data["time"]), float(data["progress"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if known != digest or not 0.0 <= time - kept <= oldest or not 0.0 <= progress < math.inf:
            return None
        return progress, time - kept

    def keep(self, digest: str, time: float, progress: float) -> None:
        """Have it written, at most every SAVE_PERIOD of `time` [s] and not while the disk still writes the last."""
        if (
            self._next_save - 10.0 * SAVE_PERIOD < time < self._next_save
        ):  # a clock set back writes at once
            return
        if self._writing is not None and not self._writing.done():
            return
        self._next_save, self._forgotten = time + SAVE_PERIOD, False
        content = json.dumps({"path": digest, "time": time, "progress": progress})
        self._writing = self._writer.submit(self._replace, content)

    def settle(self) -> None:
        """Wait until the disk is done with what was asked of it last."""
        if self._writing is not None:
            self._writing.result()

    def forget(self) -> None:
        """Have the file removed, after what is being written."""
        self._forgotten = True
        self._writing = self._writer.submit(self._remove)

    def _replace(self, content: str) -> None:
        """In one step: a reader finds the old or the new content."""
        new = self._file.with_name(self._file.name + ".new")
        try:
            new.write_text(content, encoding="utf-8")
            os.replace(new, self._file)
            self.problem = ""
        except OSError as error:
            self.problem = f"progress cannot be kept in {self._file}: {error.strerror}"

    def _remove(self) -> None:
        try:
            self._file.unlink(missing_ok=True)
        except OSError as error:
            self.problem = f"progress cannot be removed from {self._file}: {error.strerror}"
