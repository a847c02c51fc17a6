# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One run of the started robot, watched until it ends: progress, end of path or time, and what must end it before.

The fish is out of the pool, the camera is silent, or the time is up: limits without ROS and without a clock. All times are
stamps of the robot: in simulation the simulator's, so that a slow computer ends no run.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from rich.console import Console
from rich.status import Status

from fish_bringup.node_table import CONTROL, PILOT, VIEW, NodeSpec
from fish_bringup.processes import NodeProcesses
from fish_control.path_tracker import PathTracker
from fish_control.pool import HALF_LENGTH, HALF_WIDTH, wall_distance
from fish_report.errors import Interruption, UserError
from fish_report.terminal import say

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


FUSION = CONTROL[1]  # says odometry/filtered
START_TIMEOUT = 30.0  # s in which each thing that is waited for must come
# s of real time without any new stamp of the estimate, however slow the computer
STILL_TIMEOUT = 30.0
LOOK_PERIOD = 0.1  # s between looks at the robot
LAST_LOOK = 0.5  # s after the end of the path: the estimate may be there a little before the fish


@dataclass(frozen=True)
class Sight:
    """The robot's estimate of itself, last heard."""

    stamp: float  # s, header stamp
    x: float  # m
    y: float  # m
    heading: float  # rad
    speed: float  # m/s, surge


class Watch(Protocol):
    """What the watching node has heard last."""

    sight: Sight | None
    seen: Seen | None  # by the camera
    tracker: PathTracker | None
    refusal: str  # why the robot was not armed when it was last asked

    @property
    def disarmed(self) -> str | None:
        """Why the robot is disarmed; empty while it is armed, None before anybody said."""
        ...

    def ask_to_arm(self) -> None:
        """Ask a disarmed robot to be armed."""
        ...


@dataclass(frozen=True)
class SwimEnd:
    """How a run ended, and what it cost.

    Attributes:
        seconds: wall time from the first odometry to the end.
        robot_s: s of the robot's own time, that of its stamps, meanwhile.
        cpu: processor time that each node used for a second of the robot's own time [s/s].
    """

    reason: str
    seconds: float
    robot_s: float
    cpu: dict[NodeSpec, float]


@dataclass(frozen=True)
class Robot:
    """A started robot and the eyes on it."""

    nodes: NodeProcesses
    watch: Watch
    listen: Callable[[float], None]  # for so many seconds
    interruption: Interruption

    def wait_for(self, there: Callable[[], bool], what: str) -> None:
        """Listen until something is there.

        Raises:
            UserError: a node ended, or it did not come in time.
            KeyboardInterrupt: the user does not want to wait.
        """
        deadline = time.monotonic() + START_TIMEOUT
        while not there():
            self._look()
            if self.interruption.asked:
                raise KeyboardInterrupt
            if time.monotonic() > deadline:
                raise UserError(
                    f"no {what} within {START_TIMEOUT:.0f} s; see the logs of the nodes"
                )

    def arm(self) -> None:
        """Arm a robot that hurts nobody: a simulated one.

        Raises:
            UserError: it refuses; the message says why.
        """

        def armed() -> bool:
            self.watch.ask_to_arm()
            return self.watch.disarmed == ""

        try:
            self.wait_for(armed, "armed robot")
        except UserError as error:
            raise UserError(f"{error}; it was not armed: {self.watch.refusal}") from error

    def swim(self, duration: float, console: Console) -> SwimEnd:
        """Watch for at most `duration` seconds of the robot's own time, with a line of progress."""
        begin, before = time.monotonic(), self.nodes.cpu_times()
        first, _ = self._seen()
        with console.status("") as line:
            reason = self._follow(duration, line, console)
        seconds = time.monotonic() - begin
        used = {spec: spent - before[spec] for spec, spent in self.nodes.cpu_times().items()}
        last, _ = self._seen()
        robot_s = max(last.stamp - first.stamp, 1e-3)
        cpu = {spec: spent_s / robot_s for spec, spent_s in used.items()}
        return SwimEnd(reason, seconds, robot_s, cpu)

    def _follow(self, duration: float, line: Status, console: Console) -> str:
        """Until the end of the path, one lap of a closed one, the end of the time or Ctrl-C; the reason.

        Raises:
            UserError: the fish left the pool, the camera is silent, a node ended or hangs.
        """
        sight, tracker = self._seen()
        first, lap_start = sight.stamp, tracker.progress
        patience, run_watch = Patience(self.nodes), RunWatch(first)
        said = ""
        while (t := sight.stamp - first) < duration and not self.interruption.asked:
            self._look()
            sight, tracker = self._seen()
            patience.heed(sight)
            end_if_due(run_watch, sight.stamp, self.watch.seen)
            on_path = tracker.update((sight.x, sight.y))
            said = self._arm_again(t, said, console)
            line.update(
                f"{t:6.1f} s   x {sight.x:+.2f} m  y {sight.y:+.2f} m   "
                f"cross-track {1000 * on_path.cross_track_error:+4.0f} mm   speed {sight.speed:.2f} m/s   "
                f"{on_path.progress:.2f} of {tracker.path.length:.2f} m"
            )
            if on_path.finished:
                self.listen(LAST_LOOK)
                return "at the end of the path"
            if tracker.path.closed and on_path.progress - lap_start >= tracker.path.length:
                return "after one lap"
        return "as interrupted" if self.interruption.asked else f"after {duration:.0f} s"

    def _arm_again(self, t: float, said: str, console: Console) -> str:
        """A robot that was disarmed on the way at `t` [s] is armed again; one line, unless `said` is the same."""
        disarmed = self.watch.disarmed or ""
        if disarmed:
            self.watch.ask_to_arm()
            if disarmed != said:
                say(console, f"{t:.1f} s: disarmed ({disarmed}); armed again by this command")
        return disarmed

    def _seen(self) -> tuple[Sight, PathTracker]:
        if self.watch.sight is None or self.watch.tracker is None:
            raise RuntimeError("wait for odometry and path before swimming")
        return self.watch.sight, self.watch.tracker

    def _look(self) -> None:
        self.listen(LOOK_PERIOD)
        check_running(self.nodes)


class Patience:
    """Ends a run whose estimate no longer changes: the run's time is the time of its stamps and would never be over."""

    def __init__(self, nodes: NodeProcesses) -> None:
        self._nodes = nodes
        self._stamp, self._since = float("nan"), time.monotonic()

    def heed(self, sight: Sight | None) -> None:
        """Called with what was last seen, look after look.

        Raises:
            UserError: for a long time nothing new, though every node lives.
        """
        if sight is not None and sight.stamp != self._stamp:
            self._stamp, self._since = sight.stamp, time.monotonic()
        elif time.monotonic() - self._since > STILL_TIMEOUT:
            fusion = self._nodes.running.get(PILOT) or self._nodes.running[FUSION]
            raise UserError(
                f"no new odometry/filtered for {STILL_TIMEOUT:g} s: {FUSION.name}, or a node that it hears (simulator, camera, "
                f"tracker), hangs; see {fusion.log} and the logs in its folder; what was recorded is kept"
            )


def end_if_due(run_watch: RunWatch, now: float, seen: Seen | None) -> None:
    """Raise UserError with the reason for which the run must end at `now` [s], the robot's time; seen: by the camera."""
    if reason := run_watch.reason_to_end(now, seen):
        raise UserError(f"{reason}; what was recorded is kept")


def check_running(nodes: NodeProcesses) -> None:
    """Raise UserError with a node's last words if one has ended; the robot swims on without the live view."""
    for process in nodes.ended():
        if process.spec == VIEW:
            continue
        raise UserError(
            f"{process.spec.name} ended with status {process.status}: {process.last_words()} (log: {process.log})"
        )
