"""odometry/filtered -> control/target, control/twist, tracking/error, reference/path, reference/speed.

control/target (50 Hz, frame pool): position of the lookahead point, orientation of the wanted course.
control/twist (50 Hz, base_link): wanted surge speed (m/s; 0 after the end of the path) and yaw rate (rad/s,
speed times the curvature of the path). tracking/error: x cross-track (m, positive: robot left of the path), y
heading (rad, of the way over ground, mean over the stroke), z speed (m/s); wanted minus actual. reference/path and
reference/speed (transient local) on change; with path:=topic the path is taken from reference/path instead, in the
frame pool. While fusion is silent or does not vouch for the pose nothing is planned. Decisions are in Planner.
"""

import math
import os
import tempfile
import time
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3Stamped
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, Header

from fish_control.line_of_sight import Motion
from fish_control.node_configs import PlannerConfig
from fish_control.nodes.messages import (
    ERROR,
    OK,
    WARN,
    estimate_signs,
    motion_of,
    seconds,
    to_quaternion,
)
from fish_control.nodes.reporter import Reporter
from fish_control.paths import make_path, read_arguments
from fish_control.planner import Plan, Planner
from fish_control.pool import check_inside_pool
from fish_control.progress_file import ProgressFile, path_digest
from fish_control.reference_path import PathError, ReferencePath
from fish_control.watchdog import pose_loss
from fish_node.nodes.start import read_parameters, run

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PATH_STEP = 0.02  # m between poses of the published path
FRAMES = ("", "pool")  # that a path may be in; a message by hand often names none
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
        self._config = config = read_parameters(self, PlannerConfig)
        self._target = self.create_publisher(PoseStamped, "control/target", 10)
        self._twist = self.create_publisher(TwistStamped, "control/twist", 10)
        self._error = self.create_publisher(Vector3Stamped, "tracking/error", 10)
        self._speed = self.create_publisher(Float64, "reference/speed", LATCHED)
        self._reporter = Reporter(self, self._target)
        self._progress = ProgressFile(
            FilePath(config.state_file or default_state_file(self.get_namespace()))
        )
        self._planner: Planner | None = None
        self._plan: Plan | None = None
        self._fresh = False
        self._planned = -math.inf  # s, stamp of the last odometry that was planned for
        self._said_speed = math.nan
        self._bad_odometry = 0
        self._heard: tuple[float, float] | None = None  # s, when odometry came last; see _silence
        self._loss: str | None = None  # why nothing is planned from the newest odometry
        self._problem = ""
        if config.path == "topic":
            self.create_subscription(Path, "reference/path", self._on_path, LATCHED)
        else:
            self._path = self.create_publisher(Path, "reference/path", LATCHED)
            path = configured_path(config)
            self._follow(path)
            self._path.publish(to_message(path, self.get_clock().now().to_msg()))
        self.create_subscription(Odometry, "odometry/filtered", self._on_odometry, 10)
        self.create_timer(1.0, self._report)

    def end(self) -> None:
        """A planner that ends as it should leaves no progress behind."""
        self._progress.forget()
        self._progress.settle()

    def _follow(self, path: ReferencePath) -> None:
        check_inside_pool(path, self._config.margin)
        if self._planner is not None and self._planner.finished:
            self._progress.forget()  # the same path, sent again after its end, is to be swum again
        config = self._config
        self._planner = Planner(path, config.speed, config.tracker(), config.guidance())
        self._digest = path_digest(path)
        self._fresh = True

    def _on_path(self, message: Path) -> None:
        points = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
        closed = len(points) > 3 and math.dist(points[0], points[-1]) < 1e-3
        try:
            check_frames(
                {message.header.frame_id, *(pose.header.frame_id for pose in message.poses)}
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
        if not signs.finite:
            self._bad_odometry += 1
            self._loss = "odometry is not finite"
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
        target = PoseStamped(header=odometry.header)
        target.pose.position.x, target.pose.position.y = map(float, plan.at.target)
        target.pose.orientation = to_quaternion(plan.errors.course)
        twist = TwistStamped(header=Header(stamp=odometry.header.stamp, frame_id="base_link"))
        twist.twist.linear.x, twist.twist.angular.z = plan.speed, plan.yaw_rate
        error = Vector3Stamped(header=odometry.header)
        e = plan.errors
        error.vector.x, error.vector.y, error.vector.z = e.cross_track, e.heading, e.speed
        self._twist.publish(twist)
        self._error.publish(error)
        self._target.publish(target)
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
        values: dict[str, object] = {"odometry_not_finite": self._bad_odometry}
        if self._planner is None:
            level, message = WARN, "waiting for reference/path"
        elif self._plan is not None:
            path = self._planner.path
            message = (
                f"finished {path.name}" if self._planner.finished else f"following {path.name}"
            )
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


def check_frames(frames: set[str]) -> None:
    """Raise PathError if a path and its poses are not in the pool's frame: its numbers would be taken for the pool's."""
    if wrong := sorted(frames.difference(FRAMES)):
        raise PathError(
            f"frame_id is {wrong[0]!r}, expected 'pool' or none; transform the path before it is sent"
        )


def configured_path(config: PlannerConfig) -> ReferencePath:
    """The path that the parameters name. Raises PathError."""
    arguments = read_arguments(config.path_args, "path_args")
    if config.end:
        arguments["end"] = config.end
    return make_path(config.path, **arguments)


def default_state_file(namespace: str) -> str:
    """One for each user, domain and fish; no name in a `namespace` such as /fish has a dot."""
    domain, fish = os.environ.get("ROS_DOMAIN_ID", "0"), namespace.replace("/", ".")
    return f"{tempfile.gettempdir()}/fish_planner_{os.getuid()}_{domain}{fish}.json"


def to_message(path: ReferencePath, stamp: Any) -> Path:
    """Poses along the path, tangent as orientation; a closed path ends where it begins."""
    message = Path()
    message.header.frame_id, message.header.stamp = "pool", stamp
    for s in np.linspace(0.0, path.length, max(int(path.length / PATH_STEP), 2) + 1):
        pose = PoseStamped(header=message.header)
        pose.pose.position.x, pose.pose.position.y = map(float, path.point(s))
        pose.pose.orientation = to_quaternion(float(path.heading_at(s)))
        message.poses.append(pose)
    return message


def main() -> int:
    """Entry point."""
    return run(PlannerNode, "planner", PlannerNode.end)
