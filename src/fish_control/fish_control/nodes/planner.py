# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""odometry/filtered -> control/target, control/twist, tracking/error, reference/path, reference/speed.

control/target (50 Hz, frame pool): position of the lookahead point, orientation of the wanted course.
control/twist (50 Hz, base_link): wanted surge speed (m/s; 0 after the end of the path) and yaw rate (rad/s,
speed times the curvature of the path). tracking/error: x cross-track (m, positive: robot left of the path), y
heading (rad, of the way over ground, mean over the stroke), z speed (m/s); wanted minus actual. reference/path and
reference/speed (transient local) on change; with path:=topic the path is taken from reference/path instead, in the
frame pool. Services path/start, path/cancel and the topic path/status: PathService. While
fusion is silent or does not vouch for the pose nothing is planned. Decisions are in Planner.
"""

import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path as FilePath
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3Stamped
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64

from fish_control.line_of_sight import Motion
from fish_control.node_configs import PlannerConfig
from fish_control.nodes.messages import (
    ERROR,
    OK,
    WARN,
    PlanBytes,
    Reporter,
    estimate_signs,
    motion_of,
    seconds,
)
from fish_control.nodes.path_service import (
    PathService,
    State,
    check_frames,
    configured_path,
    default_state_file,
    to_message,
)
from fish_control.planner import Plan, Planner, ProgressFile, path_digest
from fish_control.pool import check_inside_pool
from fish_control.reference_path import PathError, ReferencePath
from fish_control.watchdog import IMPLAUSIBLE, pose_loss
from fish_node.nodes.parameters import Changes
from fish_node.nodes.quick_messages import hear
from fish_node.nodes.robot_clock import timer_clock
from fish_node.nodes.spin import ByEvents
from fish_node.nodes.start import read_parameters, run

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPIC = "topic"  # as path: it comes on reference/path
VOLATILE = QoSProfile(depth=1)
SETTABLE = ("path", "path_args", "end", "speed")
SILENCE = 0.5  # s without odometry that are worth a warning


class PlannerNode(Node):
    """Topics in and out of Planner."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "planner",
            namespace="fish",
            automatically_declare_parameters_from_overrides=True,
            **options,
        )
        self._config = config = read_parameters(self, PlannerConfig, SETTABLE)
        self._target = self.create_publisher(PoseStamped, "control/target", 10)
        self._twist = self.create_publisher(TwistStamped, "control/twist", 10)
        self._error = self.create_publisher(Vector3Stamped, "tracking/error", 10)
        body_frame = config.frame_prefix + config.body_frame
        self._written = PlanBytes(config.pool_frame, body_frame)
        self._speed = self.create_publisher(Float64, "reference/speed", LATCHED)
        self._reporter = Reporter(self, self._target)
        self._progress = ProgressFile(
            FilePath(config.state_file or default_state_file(self.get_namespace()))
        )
        self._planner: Planner | None = None
        self._plan: Plan | None = None
        self._fresh = self._canceled = False
        self._planned = -math.inf  # s, stamp of the last odometry that was planned for
        self._said_speed = math.nan
        self._bad_odometry = 0
        self._heard: tuple[float, float] | None = None  # s, when odometry came last; see _silence
        self._loss: str | None = None  # why nothing is planned from the newest odometry
        self._problem = ""
        self._heard_path: tuple[Path, bool] | None = None
        if config.path == TOPIC:
            self._hear_paths()
        else:
            self._path = self.create_publisher(Path, "reference/path", LATCHED)
            self._follow_own(configured_path(config))
        self._service = PathService(self, self._start, self._cancel)
        Changes(self, config, self._change)
        hear(self, Odometry, "odometry/filtered", self._on_odometry, 10)
        self.create_timer(1.0, self._report, clock=timer_clock(self))

    def end(self) -> None:
        """A planner that ends as it should leaves no progress behind."""
        self._progress.forget()
        self._progress.settle()

    def _hear_paths(self) -> None:
        """Of publishers of either durability: a latched subscription hears no volatile publisher, such as `ros2 topic pub`."""
        for qos, latched in ((LATCHED, True), (VOLATILE, False)):
            self.create_subscription(
                Path, "reference/path", partial(self._hear_path, latched=latched), qos
            )

    def _change(self, before: PlannerConfig, after: PlannerConfig) -> Callable[[], None]:
        """What takes over parameters that were set at run time. Raises ValueError to refuse them."""
        if (before.path == TOPIC) != (after.path == TOPIC):
            raise ValueError(
                "path cannot change between topic and a path at run time: start the planner again"
            )
        path = None
        if after.path != TOPIC and (before.path, before.path_args, before.end) != (
            after.path,
            after.path_args,
            after.end,
        ):
            path = configured_path(after)
            check_inside_pool(path, after.margin)

        def take_over() -> None:
            self._config = after
            if path is not None:
                self._follow_own(path)
            elif self._planner is not None:
                self._planner.speed = after.speed

        return take_over

    def _start(self) -> str:
        """Follow the path from its beginning; what it is. Raises ValueError where there is none."""
        if self._planner is None:
            raise ValueError("there is no path yet: publish reference/path first")
        self._progress.forget()
        self._follow(self._planner.path)
        return f"following {self._planner.path.name}"

    def _cancel(self) -> str:
        """Let the fish glide to a stop. Raises ValueError where it follows nothing."""
        if self._planner is None or self._planner.finished:
            raise ValueError("no path is being followed")
        self._planner.finished = True
        self._canceled = True
        return f"{self._planner.path.name} given up at {self._planner.tracker.progress:.2f} m"

    def _follow_own(self, path: ReferencePath) -> None:
        """Follow a path of the parameters, and say it."""
        self._follow(path)
        stamp = self.get_clock().now().to_msg()
        self._path.publish(to_message(path, self._config.pool_frame, stamp))

    def _follow(self, path: ReferencePath) -> None:
        check_inside_pool(path, self._config.margin)
        if self._planner is not None and self._planner.finished:
            self._progress.forget()  # the same path, sent again after its end, is to be swum again
        config = self._config
        self._planner = Planner(path, config.speed, config.tracker(), config.guidance())
        self._digest = path_digest(path)
        self._fresh, self._canceled = True, False

    def _hear_path(self, message: Path, latched: bool) -> None:
        """Take a path once: a latched publisher is heard by both subscriptions."""
        if self._heard_path == (message, not latched):
            self._heard_path = None
            return
        self._heard_path = message, latched
        self._on_path(message)

    def _on_path(self, message: Path) -> None:
        points = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
        closed = len(points) > 3 and math.dist(points[0], points[-1]) < 1e-3
        try:
            check_frames(
                {message.header.frame_id, *(pose.header.frame_id for pose in message.poses)},
                self._config.pool_frame,
            )
            path = ReferencePath.from_points(
                points, name="reference/path", closed=closed, end=self._config.ending()
            )
            self._follow(path)
            self._problem = ""
        except (PathError, ValueError) as error:
            self._problem = f"path refused: {error}"
            self.get_logger().error(self._problem)

    def _on_odometry(self, message: Odometry) -> None:
        self._heard = self._clocks()
        stamp, motion = seconds(message.header.stamp), motion_of(message)
        signs = estimate_signs(message, stamp)
        if not signs.plausible:
            self._bad_odometry += 1
            self._loss = IMPLAUSIBLE
            return
        self._loss = pose_loss(signs, self._config.largest_variance)
        if (
            self._planner is None or self._loss
        ):  # the target goes stale, so that the controller stops
            return
        if self._fresh:
            self._fresh = False
            self._begin(self._planner, stamp, motion)
        self._planner.observe(stamp, motion)
        if 0.0 <= stamp - self._planned < 0.75 / self._config.rate_hz:  # stamps jitter
            return
        self._planned = stamp
        self._publish(self._planner.plan(motion), message)
        self._progress.keep(self._digest, stamp, self._planner.tracker.progress)

    def _begin(self, planner: Planner, stamp: float, motion: Motion) -> None:
        """Resume a killed planner's progress, or start as the parameters say."""
        kept = self._progress.recall(self._digest, stamp, self._config.resume_timeout)
        if kept is not None:
            progress, age = kept
            travelled = self._config.lookahead + 2.0 * self._config.speed * age
            if planner.resume(motion.x, motion.y, progress, travelled):
                self.get_logger().info(f"resumed at {planner.tracker.progress:.2f} m of the path")
                return
        if self._config.start == "nearest":
            planner.start_nearest(motion.x, motion.y)

    def _publish(self, plan: Plan, odometry: Odometry) -> None:
        self._plan = plan
        stamp = odometry.header.stamp
        self._twist.publish(self._written.twist(stamp, plan))
        self._error.publish(self._written.error(stamp, plan))
        self._target.publish(self._written.target(stamp, plan))
        if self._state() != self._service.state:
            self._report()
        if plan.speed != self._said_speed:
            self._said_speed = plan.speed
            self._speed.publish(Float64(data=plan.speed))

    def _clocks(self) -> tuple[float, float]:
        return self.get_clock().now().nanoseconds * 1e-9, time.monotonic()

    def _silence(self) -> float:
        """s since odometry came, on the clock that says less; 0 before the first.

        Neither a clock that was set ahead is a silence, nor simulated time that runs fast, nor that which waits for a busy
        computer.
        """
        if self._heard is None:
            return 0.0
        return min(now - then for now, then in zip(self._clocks(), self._heard, strict=True))

    def _report(self) -> None:
        level, message = OK, "waiting for odometry"
        values: dict[str, object] = {"odometry_not_plausible": self._bad_odometry}
        if self._planner is None:
            level, message = WARN, "waiting for reference/path"
        elif self._plan is not None:
            path = self._planner.path
            over = "canceled" if self._canceled else "finished"
            message = f"{over if self._planner.finished else 'following'} {path.name}"
            values["progress_m"] = f"{self._plan.at.progress:.3f}"
            values["length_m"] = f"{path.length:.3f}"
            values["cross_track_m"] = f"{self._plan.errors.cross_track:.4f}"
        if self._loss:
            level, message = WARN, f"{self._loss}; nothing is planned"
        if self._planner is not None and (silence := self._silence()) > SILENCE:
            level, message = WARN, f"no odometry for {silence:.1f} s; nothing is planned"
        problem = self._problem or self._progress.problem
        if problem:
            level, message = ERROR, problem
        self._reporter.report(level, message, values)
        self._service.say(self._state(), values)

    def _state(self) -> State:
        """How far the following of the path has come."""
        if self._planner is None or self._plan is None:
            return "waiting"
        if not self._planner.finished:
            return "executing"
        return "canceled" if self._canceled else "succeeded"


def main() -> int:
    """Entry point."""
    return run(PlannerNode, "planner", PlannerNode.end, spin=ByEvents())
