# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""odometry/filtered, reference/path, tracking/error, control/gains, camera/tail, arming/state, /diagnostics -> a page.

A page in a browser shows pool, path, fish, errors, gains, health and arming state; Foxglove gets every topic over a websocket.
It only reads, unless `control` is set: then the page's button Arm calls the service arm, and STOP publishes arming/disarm,
which needs no answer. Without the package foxglove-sdk, or with its port in use, the page is served alone. It is served on
this computer only, unless another address is given.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from math import atan2
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry, Path
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

from fish_bag.message_types import message_type
from fish_bag.nodes.raw_topics import from_profile, message_class, to_profile
from fish_bag.recorder_config import common_qos
from fish_bag.topic_map import message_types
from fish_bringup.view_server import ViewServer
from fish_bringup.view_state import ViewConfig, ViewState
from fish_node.nodes.arming import ArmingListener
from fish_node.nodes.start import read_parameters, run
from fish_report.printable import plain

LOOK_PERIOD = 1.0  # s between looks for new topics


class FoxgloveBridge:
    """A websocket server with a channel for each topic of the node's namespace and each of the shared ones.

    Args:
        node: subscribes.
        address, port: of the websocket.

    Raises:
        ValueError: the package is missing, or the port is in use; the text says what to do.
    """

    SHARED = ("/tf", "/tf_static", "/diagnostics")

    def __init__(self, node: Node, address: str, port: int) -> None:
        try:
            import foxglove
        except ImportError as error:
            raise ValueError(
                "no websocket for Foxglove: pip install foxglove-sdk, or say foxglove_port:=0"
            ) from error
        self._foxglove, self._node = foxglove, node
        foxglove.set_log_level("ERROR")
        try:
            self._server = foxglove.start_server(name="robot fish", host=address, port=port)
        except (RuntimeError, OSError) as error:
            raise ValueError(
                f"no websocket for Foxglove on {address}:{port}: {error}; give another foxglove_port"
            ) from error
        self._known: set[str] = set()
        node.create_timer(LOOK_PERIOD, self._look)

    def close(self) -> None:
        """Give the port back."""
        self._server.stop()

    def _look(self) -> None:
        namespace = self._node.get_namespace()
        expected = message_types(namespace)
        for topic, _ in self._node.get_topic_names_and_types():
            if topic in self._known or not (
                topic.startswith(f"{namespace.rstrip('/')}/") or topic in self.SHARED
            ):
                continue
            offered = self._node.get_publishers_info_by_topic(topic)
            types: list[str] = sorted({info.topic_type for info in offered})
            if (
                types
            ):  # a topic that is only heard may still get a publisher of any quality of service
                own = expected.get(topic, "")
                self._pass_on(topic, own if own in types else types[0], offered)

    def _pass_on(self, topic: str, name: str, offered: Iterable[TopicEndpointInfo]) -> None:
        """One channel and one raw subscription; a topic that cannot be heard here is left out with a line."""
        self._known.add(topic)
        wanted = common_qos(
            [from_profile(info.qos_profile) for info in offered if info.topic_type == name]
        )
        try:
            schema = self._foxglove.Schema(
                name=name, encoding="ros2msg", data=message_type(name).definition
            )
            channel = self._foxglove.Channel(topic, schema=schema, message_encoding="cdr")
            self._node.create_subscription(
                message_class(name), topic, partial(_log, channel), to_profile(wanted), raw=True
            )
        except Exception as error:  # rclpy has errors of its own, as for a second type on a topic
            self._node.get_logger().warning(plain(f"{topic} ({name}) is not shown: {error}"))


def _log(channel: object, data: bytes) -> None:
    channel.log(data)  # type: ignore[attr-defined]


LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class LiveViewNode(Node):
    """Messages into ViewState, its document to ViewServer."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "live_view",
            namespace="fish",
            automatically_declare_parameters_from_overrides=True,
            **options,
        )
        config = read_parameters(self, ViewConfig)
        self._state = ViewState(config.control)
        if config.control:
            self._arm = self.create_client(SetBool, "arm")
            self._disarm = self.create_publisher(String, "arming/disarm", 10)
        self._server = ViewServer(
            config.address, config.port, self._ask if config.control else None
        )
        self._bridge = self._open_bridge(config)
        self._arming = ArmingListener(self)
        self.create_subscription(Odometry, "odometry/filtered", self._on_odometry, NEWEST)
        self.create_subscription(Path, "reference/path", self._on_path, LATCHED)
        self.create_subscription(Vector3Stamped, "tracking/error", self._on_error, NEWEST)
        self.create_subscription(Float64MultiArray, "control/gains", self._on_gains, NEWEST)
        self.create_subscription(JointState, "camera/tail", self._on_tail, NEWEST)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / config.rate_hz, self._show, clock=steady)
        self.get_logger().info(f"live view: {self._server.url}")

    def _open_bridge(self, config: ViewConfig) -> FoxgloveBridge | None:
        if config.foxglove_port == 0:
            return None
        try:
            return FoxgloveBridge(self, config.address, config.foxglove_port)
        except ValueError as error:
            self.get_logger().warning(str(error))
            return None

    def _ask(self, armed: bool) -> None:
        """Called by the server's thread; the answer shows in arming/state."""
        if armed:
            self._arm.call_async(SetBool.Request(data=True))
        else:
            self._disarm.publish(String(data="STOP was pressed in the live view"))

    def _on_odometry(self, message: Odometry) -> None:
        p, q, stamp = (
            message.pose.pose.position,
            message.pose.pose.orientation,
            message.header.stamp,
        )
        pose = (p.x, p.y, 2.0 * atan2(q.z, q.w))  # rotation about z only
        self._state.move(stamp.sec + 1e-9 * stamp.nanosec, pose, message.twist.twist.linear.x)

    def _on_path(self, message: Path) -> None:
        self._state.path = [(p.pose.position.x, p.pose.position.y) for p in message.poses]

    def _on_error(self, message: Vector3Stamped) -> None:
        self._state.errors = (message.vector.x, message.vector.y, message.vector.z)

    def _on_gains(self, message: Float64MultiArray) -> None:
        self._state.gains = tuple(message.data)

    def _on_tail(self, message: JointState) -> None:
        self._state.tail = tuple(message.position)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        own = f"{self.get_namespace().strip('/')}/"
        for status in message.status:
            name = status.name.lstrip("/")
            if name.startswith(own):
                self._state.health(
                    name.removeprefix(own), int.from_bytes(status.level), status.message
                )

    def _show(self) -> None:
        self._state.armed, self._state.reason = self._arming.armed, self._arming.reason
        now = self.get_clock().now().nanoseconds * 1e-9
        self._server.state = self._state.document(now)

    def destroy_node(self) -> None:
        """Give the ports back."""
        self._server.close()
        if self._bridge is not None:
            self._bridge.close()
        super().destroy_node()


def main() -> int:
    """Entry point."""
    return run(LiveViewNode, "live_view")
