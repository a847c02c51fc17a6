# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The live view and driving by hand, with nodes."""

import json
import os
import pty
import socket
import time
import tty
import urllib.request

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from fish_bringup.nodes.live_view import LiveViewNode
from fish_bringup.nodes.operator import Pad, driving
from fish_bringup.verbs.drive import Keyboard
from fish_bringup.view_server import HEADER
from fish_control.manual_drive import ManualDrive

pytestmark = pytest.mark.ros


LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PATIENCE = 30.0  # s


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Robot:
    """A live view, and a node that stands for the robot."""

    def __init__(self, **parameters):
        self.port = free_port()
        given = {"port": self.port, "foxglove_port": 0, **parameters}
        self.node = LiveViewNode(
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()]
        )
        self.other = Node("robot", namespace="fish")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.other)
        self.asked = []
        self.other.create_service(SetBool, "arm", self._on_arm)
        self.odometry = self.other.create_publisher(Odometry, "odometry/filtered", 10)

    def _on_arm(self, request, response):
        self.asked.append(request.data)
        return response

    def until(self, condition):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline
            self.executor.spin_once(timeout_sec=0.05)

    def swim(self, x):
        message = Odometry()
        message.pose.pose.position.x, message.pose.pose.orientation.w = x, 1.0
        message.header.stamp = self.other.get_clock().now().to_msg()
        self.odometry.publish(message)

    def shown(self):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/state", timeout=20) as answer:
            return json.loads(answer.read())

    def press(self, button):
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.port}/{button}", data=b"", headers={HEADER: "1"}
        )
        urllib.request.urlopen(request, timeout=20).close()


@pytest.fixture
def robot(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "145")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init()
    made = []

    def make(**parameters):
        made.append(Robot(**parameters))
        return made[-1]

    yield make
    for one in made:
        one.executor.shutdown()
        one.node.destroy_node()
        one.other.destroy_node()
    rclpy.try_shutdown()


def test_the_page_gets_pose_path_and_health(robot):
    r = robot()
    paths = r.other.create_publisher(Path, "reference/path", LATCHED)
    said = r.other.create_publisher(DiagnosticArray, "/diagnostics", 10)
    r.until(lambda: said.get_subscription_count() and r.odometry.get_subscription_count())
    paths.publish(Path())
    names = ("fish/fusion", "fish_2/fusion")
    said.publish(
        DiagnosticArray(
            status=[
                DiagnosticStatus(name=name, level=DiagnosticStatus.WARN, message="waiting")
                for name in names
            ]
        )
    )
    r.swim(0.7)
    r.until(lambda: r.shown().get("health") and r.shown()["pose"])
    assert r.shown()["pose"] == [0.7, 0.0, 0.0]
    assert r.shown()["health"] == [{"node": "fusion", "level": "warn", "message": "waiting"}]
    assert r.shown()["control"] is False


def test_with_control_stop_disarms_and_arm_asks_the_owner(robot):
    r = robot(control=True)
    stopped = []
    r.other.create_subscription(String, "arming/disarm", lambda m: stopped.append(m.data), 10)
    r.until(lambda: r.node._arm.service_is_ready() and r.node._disarm.get_subscription_count())
    r.press("disarm")
    r.until(lambda: stopped)
    assert stopped == ["STOP was pressed in the live view"]
    assert r.asked == []
    r.press("arm")
    r.until(lambda: r.asked)
    assert r.asked == [True]


def test_foxglove_s_port_in_use_leaves_the_page_alone(robot):
    pytest.importorskip("foxglove")
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        r = robot(foxglove_port=other.getsockname()[1])
        assert r.node._bridge is None
        r.until(lambda: "pool" in r.shown())


def test_foxglove_gets_a_channel_for_each_topic_of_the_robot(robot):
    pytest.importorskip("foxglove")
    r = robot(foxglove_port=free_port())
    stranger = Node("stranger", namespace="fish_2")
    stranger.create_publisher(Odometry, "odometry/filtered", 10)
    try:
        r.until(lambda: "/fish/odometry/filtered" in r.node._bridge._known)
        assert not any(topic.startswith("/fish_2/") for topic in r.node._bridge._known)
    finally:
        stranger.destroy_node()


@pytest.fixture
def foreign(robot):
    """A node in a process's context of its own, as one middleware participant has one type for a topic."""
    context = Context()
    rclpy.init(context=context)
    node = Node("foreign", namespace="fish", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def test_a_foreign_type_on_a_topic_of_the_robot_does_not_end_the_view(robot, foreign):
    pytest.importorskip("foxglove")
    foreign.create_publisher(DiagnosticArray, "odometry/filtered", 10)  # sorts before the own type
    foreign.create_publisher(DiagnosticArray, "tracking/error", 10)
    r = robot(foxglove_port=free_port())
    topics = {"/fish/odometry/filtered", "/fish/tracking/error"}
    r.until(lambda: topics <= r.node._bridge._known)
    r.until(lambda: r.odometry.get_subscription_count() == 2)  # the page's and Foxglove's
    r.until(lambda: r.swim(0.3) or r.shown()["pose"])
    assert r.shown()["pose"]
    assert topics <= r.node._bridge._known


def test_foxglove_hears_a_node_that_comes_after_the_view(robot):
    pytest.importorskip("foxglove")
    r = robot(foxglove_port=free_port())
    r.until(lambda: "/fish/odometry/filtered" in r.node._bridge._known)
    end = time.monotonic() + 2.5
    while time.monotonic() < end:
        r.executor.spin_once(timeout_sec=0.05)
    said = r.other.create_publisher(DiagnosticArray, "/diagnostics", 10)
    r.until(lambda: said.get_subscription_count() == 2)
    assert said.get_subscription_count() == 2


DOMAIN = 146


@pytest.fixture
def driven_robot(monkeypatch):
    """A node that hears commands, and one that drives."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    drive = ManualDrive(0.5)
    with driving(DOMAIN, "/fish", drive, Pad()) as (node, spin):
        rclpy.init(context=context, domain_id=DOMAIN)
        other = rclpy.create_node("driven_robot", namespace="/fish", context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(other)

        def until(condition):
            deadline = time.monotonic() + PATIENCE
            while not condition():
                assert time.monotonic() < deadline
                spin(0.02)
                executor.spin_once(timeout_sec=0.0)

        yield other, node, until
        executor.shutdown()
        other.destroy_node()
        context.try_shutdown()


def test_a_gamepad_drives_while_its_deadman_is_held(driven_robot):
    other, node, until = driven_robot
    heard, deadman = [], []
    other.create_subscription(JointState, "joint_command", heard.append, 100)
    other.create_subscription(Bool, "operator/deadman", deadman.append, 10)
    pad = other.create_publisher(Joy, "joy", 10)
    until(lambda: heard and deadman and pad.get_subscription_count())
    assert deadman[-1].data is False
    assert heard[-1].velocity[0] == 0.0
    held = Joy(axes=[0.5, 0.8], buttons=[0, 0, 0, 0, 0, 1])

    def swims():
        pad.publish(held)
        return deadman[-1].data and heard[-1].position[1] == pytest.approx(0.4)

    until(swims)
    pad.publish(Joy(axes=[0.5, 0.8], buttons=[0] * 6))
    until(lambda: not deadman[-1].data and heard[-1].position[1] == 0.0)
    pad.publish(Joy(axes=[], buttons=[]))  # another kind of pad
    assert node.rivals == 0
    other.create_publisher(JointState, "joint_command", 10)
    until(lambda: node.rivals == 1)


DEADMAN, ARM, STOP = Pad.deadman, Pad.arm, Pad.stop


def joy(*pressed, throttle=0.0):
    buttons = [int(number in pressed) for number in range(8)]
    return Joy(axes=[0.0, throttle], buttons=buttons)


def test_a_button_arms_while_the_deadman_is_held_and_the_throttle_at_rest(driven_robot):
    other, node, until = driven_robot
    asked, disarmed = [], []

    def on_arm(request, response):
        asked.append(request.data)
        response.success, response.message = len(asked) > 1, "water in the hull"
        return response

    other.create_service(SetBool, "arm", on_arm)
    other.create_subscription(String, "arming/disarm", disarmed.append, 10)
    pad = other.create_publisher(Joy, "joy", 10)
    until(lambda: pad.get_subscription_count() and other.count_publishers("arming/disarm"))

    def press(*pressed, throttle=0.0):
        pad.publish(joy())
        pad.publish(joy(*pressed, throttle=throttle))
        return True

    press(ARM)  # without the deadman
    press(DEADMAN, ARM, throttle=0.5)
    until(lambda: node.answer == "not armed: let the throttle go first")
    assert asked == []
    until(lambda: press(DEADMAN, ARM) and node.answer == "not armed: water in the hull")
    refused = len(asked)
    assert all(asked)
    until(lambda: press(DEADMAN, ARM) and len(asked) > refused and node.answer != "")
    assert disarmed == []
    before = len(asked)
    until(lambda: press(DEADMAN, STOP, ARM) and disarmed)
    assert disarmed[0].data == "stopped by a button of the gamepad"
    assert not node.drive.held(time.monotonic())
    assert len(asked) == before


def test_arrow_keys_come_as_words_and_others_as_characters():
    """Of several at once q comes first, then one that is no arrow."""
    ours, theirs = pty.openpty()
    try:
        tty.setcbreak(theirs)
        keys = Keyboard(theirs)
        assert keys.key() is None
        several = ((b"q\x1b[A", "q"), (b"q ", "q"), (b" \x1b[A", " "), (b"\x1b[A" * 40, "up"))
        last = ((b"\x1b[A\x1b[D", "left"), (b"\x1b", "\x1b"))
        for sent, word in ((b"\x1b[A", "up"), (b"q", "q"), (b" ", " "), *several, *last):
            os.write(ours, sent)
            deadline = time.monotonic() + PATIENCE
            while (key := keys.key()) is None:
                assert time.monotonic() < deadline
            assert key == word
    finally:
        os.close(ours)
        os.close(theirs)
