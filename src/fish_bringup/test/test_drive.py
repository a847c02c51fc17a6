# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Driving by hand on ROS: a gamepad's deadman, and keys of a real terminal."""

import os
import pty
import time
import tty

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from fish_bringup.keyboard import Keyboard
from fish_bringup.nodes.hand_drive import Pad, driving
from fish_control.manual_drive import ManualDrive

pytestmark = pytest.mark.ros
DOMAIN = 146
PATIENCE = 30.0  # s


@pytest.fixture
def robot(monkeypatch):
    """A node that hears commands, and one that drives."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    drive = ManualDrive(0.5)
    with driving(DOMAIN, "/fish", drive, Pad()) as (node, spin):
        rclpy.init(context=context, domain_id=DOMAIN)
        other = rclpy.create_node("robot", namespace="/fish", context=context)
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


def test_a_gamepad_drives_while_its_deadman_is_held(robot):
    other, node, until = robot
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


def test_a_button_arms_while_the_deadman_is_held_and_the_throttle_at_rest(robot):
    other, node, until = robot
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
    until(lambda: press(STOP) and disarmed)
    assert disarmed[0].data == "stopped by a button of the gamepad"


def test_arrow_keys_come_as_words_and_others_as_characters():
    ours, theirs = pty.openpty()
    try:
        tty.setcbreak(theirs)
        keys = Keyboard(theirs)
        assert keys.key() is None
        for sent, word in ((b"\x1b[A", "up"), (b"\x1b[D", "left"), (b"q", "q"), (b" ", " ")):
            os.write(ours, sent)
            deadline = time.monotonic() + PATIENCE
            while (key := keys.key()) is None:
                assert time.monotonic() < deadline
            assert key == word
    finally:
        os.close(ours)
        os.close(theirs)
