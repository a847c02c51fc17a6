# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arming state in ROS: the node that owns it serves and publishes it, the others listen.

Owner (node rotor on the robot, node simulator in simulation). Service arm (std_srvs/SetBool: true arms, false disarms).
Out: arming/state (diagnostic_msgs/DiagnosticArray: level OK is armed, the message is the reason), 20 Hz and on change.
In: odometry/filtered, camera/pose, operator/estop and operator/deadman (std_msgs/Bool), arming/disarm (std_msgs/String:
another node's reason to disarm), arming/pause (std_msgs/String: why a node pauses its commands, repeated while it does; empty:
it goes on), arming/state of another owner: one call would arm both, a simulation's the robot.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from uuid import uuid4

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, Header, String
from std_srvs.srv import SetBool

from fish_node.arming import (
    CAMERA,
    DEADMAN,
    ESTOP,
    ODOMETRY,
    OWNER,
    PAUSE,
    Arming,
    ArmingSettings,
    can_be_in_a_pool,
    can_be_swum,
    estimate_trouble,
    largest_of,
    visible,
)
from fish_node.nodes.message_bytes import MessageBytes
from fish_node.nodes.quick_messages import (
    BODY,
    MALFORMED,
    SELDOM_S,
    STAMP,
    hear,
    malformed,
    read_stamp,
)

STATE_PERIOD_S = 0.05
PLANAR = (0, 7, 35)  # x, y and rotation about z on the diagonal of a covariance of 6
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
ARMED = "armed"
FORGOTTEN_S = 1.0  # s; an owner says its state more often
SILENT = f"no arming/state for {FORGOTTEN_S:g} s: the node rotor or simulator is gone"
NEVER_HEARD = "no arming/state yet: the node rotor or simulator publishes it"
ONE_TOO_MANY = "stop one of the two, or give it another domain"
AFTER_STAMP = BODY + STAMP.size  # bytes of a message with a header


class ArmingServer:
    """Serves and publishes the arming state of a node, and hears its sources.

    Args:
        node: the owner.
        arming: the state.
        clock: s, the clock of the arming state.
        stamp: of messages; the node's clock unless said otherwise.
    """

    def __init__(
        self,
        node: Node,
        arming: Arming,
        settings: ArmingSettings,
        clock: Callable[[], float],
        stamp: Callable[[], Time] | None = None,
    ) -> None:
        self._node, self._arming, self._settings, self._clock = node, arming, settings, clock
        self._now = stamp or (lambda: node.get_clock().now().to_msg())
        self._id = f"{node.get_fully_qualified_name()} {uuid4().hex[:8]}"
        self._stamps: dict[str, Time] = {}
        self._publishing = threading.Lock()  # a device's thread says a change at once
        self._said: str | None = None
        self._written: tuple[tuple[object, ...], MessageBytes] = (), MessageBytes(Header(), 0)
        self._state = node.create_publisher(DiagnosticArray, "arming/state", 10)
        node.create_service(SetBool, "arm", self._on_arm)
        if settings.estimate != "ignored":
            hear(node, Odometry, "odometry/filtered", self._on_odometry, NEWEST)
            hear(node, PoseWithCovarianceStamped, "camera/pose", self._on_camera, NEWEST)
        if settings.deadman_timeout_s > 0.0:
            node.create_subscription(Bool, "operator/deadman", self._on_deadman, 10)
        node.create_subscription(DiagnosticArray, "arming/state", self._on_state, 10, raw=True)
        node.create_subscription(Bool, "operator/estop", self._on_estop, 10)
        node.create_subscription(String, "arming/pause", self._on_pause, 10)
        node.create_subscription(String, "arming/disarm", self._on_disarm, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(STATE_PERIOD_S, self.publish, clock=steady)

    def say_change(self) -> None:
        """Publish and log at once if the state is not the one published last."""
        if self._arming.reason != self._said:
            self.publish()

    def publish(self) -> None:
        """Publish the state; log it if it changed. Any thread may call it."""
        with self._publishing:
            self._publish(*self._arming.state(self._clock()))

    def _publish(self, armed: bool, reason: str, count: int) -> None:
        if reason != self._said:
            self._said = reason
            log = self._node.get_logger()
            if armed:
                log.info("armed: the motors follow commands")
            else:
                log.warning(f"disarmed: {reason}")
        level = DiagnosticStatus.OK if armed else DiagnosticStatus.WARN
        said = (level, reason, count)
        if said != self._written[0]:
            status = DiagnosticStatus(
                name="arming", level=level, message=reason or ARMED, hardware_id=self._id
            )
            status.values = [KeyValue(key="count", value=str(count))]
            self._written = said, MessageBytes(DiagnosticArray(status=[status]), 0)
        try:
            self._state.publish(self._written[1](self._now()))
        except RCLError:  # a device's thread lives a little longer than the context
            if self._node.context.ok():
                raise

    def _on_arm(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if request.data:
            refusal = self._arming.arm(self._clock())
            response.success, response.message = not refusal, refusal or "armed"
        else:
            self._arming.disarm("disarmed by the operator")
            response.success, response.message = True, "disarmed"
        self.publish()
        return response

    def _on_odometry(self, message: Odometry) -> None:
        if not self._is_new(ODOMETRY, message.header.stamp):
            return
        pose, twist = message.pose, message.twist
        position, speed = pose.pose.position, twist.twist
        q = pose.pose.orientation
        moves = (speed.linear.x, speed.linear.y, speed.angular.z)
        trouble = estimate_trouble(
            largest_of(pose.covariance[i] for i in PLANAR),
            largest_of(twist.covariance[i] for i in PLANAR),
            can_be_in_a_pool(position.x, position.y, q.z, q.w) and can_be_swum(moves),
            self._settings.largest_variance,
        )
        self._arming.heard(ODOMETRY, self._clock(), trouble)

    def _on_camera(self, message: PoseWithCovarianceStamped) -> None:
        place = message.pose.pose
        at, turned = place.position, place.orientation
        seen = can_be_in_a_pool(at.x, at.y, turned.z, turned.w)
        if seen and self._is_new(CAMERA, message.header.stamp):
            self._arming.heard(CAMERA, self._clock())

    def _on_deadman(self, message: Bool) -> None:
        trouble = "" if message.data else "the operator let the deadman go"
        self._hear_operator(DEADMAN, trouble)

    def _on_estop(self, message: Bool) -> None:
        trouble = "emergency stop is pressed" if message.data else ""
        self._hear_operator(ESTOP, trouble)

    def _hear_operator(self, source: str, trouble: str) -> None:
        """Judged at once: the next message may take a short word back."""
        self._arming.heard(source, self._clock(), trouble)
        self._arming.check(self._clock())
        self.say_change()

    def _on_state(self, data: bytes) -> None:
        if self._id.encode() in data:  # its own, twenty times a second
            return
        message = state_of(data, self._node)
        others = [status.hardware_id for status in message.status if status.hardware_id != self._id]
        if others:
            trouble = f"{owner(others[0])} says arming/state, too: {ONE_TOO_MANY}"
            self._arming.heard(OWNER, self._clock(), trouble)

    def _on_disarm(self, message: String) -> None:
        self._arming.disarm(message.data or "a node asked for it without a reason")
        self.say_change()

    def _on_pause(self, message: String) -> None:
        self._arming.heard(PAUSE, self._clock(), message.data)

    def _is_new(self, source: str, stamp: Time) -> bool:
        """Whether a message is not the one before again: one that repeats a stamp says nothing new."""
        before, self._stamps[source] = self._stamps.get(source), stamp
        return bool(stamp != before)


def state_of(data: bytes, node: Node) -> DiagnosticArray:
    """The message of these bytes; one without a status where they are none."""
    try:
        return deserialize_message(data, DiagnosticArray)
    except MALFORMED as error:
        line = malformed(DiagnosticArray, data, error)
        node.get_logger().warning(f"arming/state: {line}", throttle_duration_sec=SELDOM_S)
        return DiagnosticArray()


def owner(hardware_id: str) -> str:
    """The node in the hardware_id of arming/state."""
    return visible(hardware_id.partition(" ")[0]) or "a node without a name"


class ArmingListener:
    """What a node hears of the arming state. Of several owners every one must say that the robot is armed.

    Attributes:
        armed: None before the first word.
        reason: why the robot is disarmed; empty while it is armed and before the first word.

    Args:
        node: hears arming/state.
        on_state: called after each word of an owner.
        clock: s, monotonic; by it an owner that is silent for FORGOTTEN_S has no say.
        is_new: whether a stamp is one of now; a word with another, such as that of a recording, is not heard.
    """

    def __init__(
        self,
        node: Node,
        on_state: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
        is_new: Callable[[Time], bool] = lambda _: True,
    ) -> None:
        self.armed: bool | None = None
        self.reason = ""
        self._node, self._on_state, self._clock, self._is_new = node, on_state, clock, is_new
        self._known = b""  # the newest message after its stamp
        self._words: dict[str, str] = {}  # of that message: owner -> why disarmed, empty if armed
        self._heard: dict[str, tuple[float, str]] = {}  # owner -> s, the same
        node.create_subscription(DiagnosticArray, "arming/state", self._on_message, 10, raw=True)

    def forbids(self, required: bool) -> str:
        """Why nothing may move; empty if it may. required: a state that nobody says, or says any more, forbids it, too."""
        if not required or self.reason:
            return self.reason
        newest = max((heard for heard, _ in self._heard.values()), default=-math.inf)
        if self.armed is None:
            return NEVER_HEARD
        return "" if self._clock() - newest < FORGOTTEN_S else SILENT

    def _on_message(self, data: bytes) -> None:
        """Twenty times a second, and mostly what is known but for the stamp."""
        if len(data) < AFTER_STAMP or not self._is_new(read_stamp(data)):
            return
        if data[AFTER_STAMP:] != self._known:
            self._known = data[AFTER_STAMP:]
            self._words = {}
            for status in state_of(data, self._node).status:
                why = "" if status.level == DiagnosticStatus.OK else status.message or "disarmed"
                self._words[status.hardware_id] = self._words.get(status.hardware_id) or why
        if self._words:
            self._judge(self._clock())
            self._on_state()

    def _judge(self, now: float) -> None:
        self._heard |= {who: (now, why) for who, why in self._words.items()}
        self._heard = {k: word for k, word in self._heard.items() if now - word[0] < FORGOTTEN_S}
        reasons = [why for _, why in self._heard.values() if why]
        if reasons and len(self._heard) > 1:
            owners = " and ".join(owner(who) for who in list(self._heard)[:2])
            reasons.insert(0, f"{owners} say arming/state: {ONE_TOO_MANY}")
        self.armed, self.reason = not reasons, visible("; ".join(reasons))
