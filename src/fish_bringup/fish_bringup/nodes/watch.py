# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Watches a run from outside, for progress lines and tests: where the robot is, what the nodes say.

In: odometry/filtered, camera/pose, reference/path, arming/state, /diagnostics. Out: nothing; it may call the service arm.
Not a process of its own: it lives in the command that starts the robot.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import atan2, inf

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from fish_bringup.node_table import NAMESPACE, middleware
from fish_bringup.run_watch import Seen, Sight
from fish_bringup.score import path_from_points
from fish_control.path_tracker import PathTracker
from fish_node.nodes.arming import ArmingListener

STATE_TIMEOUT = 2.0  # s without arming/state: its owner is gone
ASK_AGAIN = 0.5  # s between two requests to arm
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class WatchNode(Node):
    """Keeps the latest of what it hears; progress and cross-track error from the path followed in order."""

    def __init__(self, context: Context, namespace: str = NAMESPACE) -> None:
        super().__init__("watch", namespace=namespace, context=context)
        self.sight: Sight | None = None
        self.seen: Seen | None = None
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.levels: dict[str, tuple[int, str]] = {}
        self.tracker: PathTracker | None = None
        self.refusal = "the service arm is not there"
        self._arming, self._ask_at = ArmingListener(self, self._on_state), 0.0
        self._state_at = -inf  # s, when arming/state was heard last
        self._arm = self.create_client(SetBool, "arm")
        self.create_subscription(Path, "reference/path", self._on_path, LATCHED)
        self.create_subscription(Odometry, "odometry/filtered", self._on_odometry, 1)
        self.create_subscription(PoseWithCovarianceStamped, "camera/pose", self._on_camera, 1)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)

    def sees(self, node: str) -> bool:
        """Whether a node of this name is in the graph."""
        return (node, self.get_namespace()) in self.get_node_names_and_namespaces()

    @property
    def disarmed(self) -> str | None:
        """Why the robot is disarmed; empty while it is armed, None while nobody says."""
        heard = time.monotonic() - self._state_at < STATE_TIMEOUT
        return self._arming.reason if heard else None

    def ask_to_arm(self) -> None:
        """Ask a disarmed robot to be armed, at most every ASK_AGAIN; `refusal` says why it was not."""
        now = time.monotonic()
        if self.disarmed == "" or now < self._ask_at or not self._arm.service_is_ready():
            return
        self._ask_at = now + ASK_AGAIN
        self._arm.call_async(SetBool.Request(data=True)).add_done_callback(self._on_answer)

    def _on_state(self) -> None:
        self._state_at = time.monotonic()

    def _on_answer(self, future: Future) -> None:
        answer = future.result()
        if answer is not None and not answer.success:
            self.refusal = answer.message

    def _on_path(self, msg: Path) -> None:
        if self.tracker is None and len(msg.poses) > 1:
            points = np.array([[pose.pose.position.x, pose.pose.position.y] for pose in msg.poses])
            self.tracker = PathTracker(path_from_points(points))

    def _on_odometry(self, msg: Odometry) -> None:
        position, q = msg.pose.pose.position, msg.pose.pose.orientation
        heading = 2.0 * atan2(q.z, q.w)  # rotation about z only
        self.sight = Sight(
            seconds(msg.header), position.x, position.y, heading, msg.twist.twist.linear.x
        )

    def _on_camera(self, msg: PoseWithCovarianceStamped) -> None:
        position = msg.pose.pose.position
        self.seen = Seen(seconds(msg.header), position.x, position.y)

    def _on_diagnostics(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            name = status.name.lstrip("/")
            self.diagnostics[name] = {item.key: item.value for item in status.values}
            self.levels[name] = (int.from_bytes(status.level), status.message)


def seconds(header: Header) -> float:
    """The stamp [s]."""
    return float(header.stamp.sec + 1e-9 * header.stamp.nanosec)


@contextmanager
def watching(
    domain: int, namespace: str = NAMESPACE
) -> Iterator[tuple[WatchNode, Callable[[float], None]]]:
    """A WatchNode in an own context of the domain, and a function that listens for so many seconds.

    Signals stay with the caller: ROS installs no handlers.
    """
    os.environ.update(middleware())
    context = Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = WatchNode(context, namespace)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def listen(seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)

    try:
        yield node, listen
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
