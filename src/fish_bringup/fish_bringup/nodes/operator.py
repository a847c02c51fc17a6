# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The operator: arms the robot, and drives rotor and rudder by hand.

Arming calls the service arm of the owner of the arming state (node rotor, or the simulator). Driving lives in the command
`robofish drive`: joy -> joint_command, operator/deadman, arming/disarm.

joint_command (100 Hz) as the controller's; joy (sensor_msgs/Joy): the deadman's button must be held, axes give throttle and
rudder. operator/deadman (std_msgs/Bool, 10 Hz) is true while the operator holds the deadman. A button arms the robot (service
arm) while the deadman is held and the throttle is at rest; another one disarms it at any time.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from fish_bringup.node_table import middleware
from fish_control.manual_drive import ManualDrive
from fish_node.nodes.arming import ArmingListener
from fish_report.errors import UserError


def set_armed(armed: bool, namespace: str, domain: int | None, timeout: float) -> tuple[bool, str]:
    """Arm or disarm the robot of a namespace; whether it was done, and what the robot said.

    Args:
        armed: true arms, false disarms.
        namespace: of the robot, such as /fish.
        domain: ROS domain; None: that of the environment.
        timeout: s to wait for the service and for its answer.

    Raises:
        UserError: nobody serves arm there, or nobody answers.
    """
    context = Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("operator", namespace=namespace, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    client, name = node.create_client(SetBool, "arm"), f"{namespace.rstrip('/')}/arm"
    try:
        if not client.wait_for_service(timeout):
            raise UserError(
                f"no service {name} on ROS domain {context.get_domain_id()} within {timeout:g} s; start the robot "
                "(node rotor, or the simulator), or give --domain and --namespace"
            )
        future = client.call_async(SetBool.Request(data=armed))
        executor.spin_until_future_complete(future, timeout)
        answer = future.result() if future.done() else None
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    if answer is None:
        raise UserError(f"{name} did not answer within {timeout:g} s; see the log of its node")
    return bool(answer.success), str(answer.message)


PERIOD = 0.01  # s, of joint_command
DEADMAN_EVERY = 10  # commands
RUN_DOWN = 0.6  # s, from full throttle to rest
AT_REST = 0.05  # of full throttle


@dataclass(frozen=True)
class Pad:
    """Which button and axes of a gamepad do what."""

    deadman: int = 5  # button
    arm: int = 7  # button
    stop: int = 1  # button
    throttle: int = 1  # axis, forward is positive
    rudder: int = 0  # axis, left is positive


class HandDrive(Node):
    """ManualDrive's command into messages; a gamepad's into ManualDrive.

    Attributes:
        answer: what came of the arm button last; empty before it is pressed.
    """

    def __init__(self, context: Context, namespace: str, drive: ManualDrive, pad: Pad) -> None:
        super().__init__("hand_drive", namespace=namespace, context=context)
        self.drive, self._pad, self._ticks = drive, pad, 0
        self.answer = ""
        self._pressed: set[int] = set()
        self.arming = ArmingListener(self)
        self._arm = self.create_client(SetBool, "arm")
        self._disarm = self.create_publisher(String, "arming/disarm", 10)
        self._command = self.create_publisher(JointState, "joint_command", 10)
        self._deadman = self.create_publisher(Bool, "operator/deadman", 10)
        self.create_subscription(Joy, "joy", self._on_joy, 10)
        self.create_timer(PERIOD, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def rivals(self) -> int:
        """Other publishers of joint_command."""
        return int(self.count_publishers("joint_command")) - 1

    def _on_joy(self, message: Joy) -> None:
        pad = self._pad
        buttons, axes = message.buttons, message.axes
        down = {number for number, value in enumerate(buttons) if value}
        new, self._pressed = down - self._pressed, down
        if pad.stop in new:
            self._disarm.publish(String(data="stopped by a button of the gamepad"))
        if pad.stop in down:
            self.drive.release()
            return
        if len(axes) <= max(pad.throttle, pad.rudder) or pad.deadman not in down:
            self.drive.release()
            return
        self.drive.hold(time.monotonic())
        self.drive.wish(axes[pad.throttle], axes[pad.rudder])
        if pad.arm in new:
            self._ask_to_arm()

    def _ask_to_arm(self) -> None:
        if self.drive.throttle > AT_REST:
            self.answer = "not armed: let the throttle go first"
        elif not self._arm.service_is_ready():
            self.answer = "not armed: the service arm is not there"
        else:
            self._arm.call_async(SetBool.Request(data=True)).add_done_callback(self._on_answer)

    def _on_answer(self, future: Future) -> None:
        answer = future.result()
        if answer is not None:
            self.answer = answer.message if answer.success else f"not armed: {answer.message}"

    def _tick(self) -> None:
        now = time.monotonic()
        command = self.drive.command(now, PERIOD)
        message = JointState(name=["rotor", "rudder"])
        message.header.stamp = self.get_clock().now().to_msg()
        message.position = [command.phase, command.alpha]
        message.velocity = [command.rotor_speed, 0.0]
        self._command.publish(message)
        if self._ticks % DEADMAN_EVERY == 0:
            self._deadman.publish(Bool(data=self.drive.held(now)))
        self._ticks += 1


@contextmanager
def driving(
    domain: int | None, namespace: str, drive: ManualDrive, pad: Pad
) -> Iterator[tuple[HandDrive, Callable[[float], None]]]:
    """A HandDrive in an own context of the domain (None: the environment's), and a function that runs it for so many seconds.

    Signals stay with the caller. At the end the last command is one of rest.
    """
    os.environ.update(middleware())
    context = Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = HandDrive(context, namespace, drive, pad)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin(seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)

    try:
        yield node, spin
        drive.release()
        spin(RUN_DOWN)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
