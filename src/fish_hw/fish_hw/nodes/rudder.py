# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `rudder`: the servo that bends the tail.

In:  joint_command (joint rudder: position = alpha [rad], positive steers left), arming/state
Out: servo pulses, rudder/trouble (std_msgs/String, 20 Hz: empty, or why the rudder does not work), /diagnostics
"""

import math
import tempfile
from dataclasses import replace
from pathlib import Path

from builtin_interfaces.msg import Time
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from fish_hw.devices.rudder_driver import PwmOutput, RudderDriver
from fish_hw.devices.rudder_output import open_output
from fish_hw.emulators.pwm import PwmChipEmulator
from fish_hw.nodes.device_node import DeviceNode, joint_value, run
from fish_hw.settings import RudderSettings
from fish_node.nodes.arming import FORGOTTEN_S, ArmingListener
from fish_node.nodes.robot_clock import timer_clock

TROUBLE_PERIOD_S = 0.05


class RudderNode(DeviceNode):
    """Commands in, pulses out; limits, arming state and watchdog are in RudderServo."""

    def __init__(self) -> None:
        super().__init__("rudder", RudderSettings)
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._driver = RudderDriver(self.settings, self._open_output, self.clock.now)
        self.create_subscription(JointState, "joint_command", self._on_command, QoSProfile(depth=1))
        self._arming = ArmingListener(self, self._on_state, is_new=self._is_new)
        self._trouble = self.create_publisher(String, "rudder/trouble", 10)
        self.create_timer(TROUBLE_PERIOD_S, self._say_trouble, clock=timer_clock(self))
        emulated = self.settings.backend == "emulator"
        self.use(self._driver, self._cycle, 1.0 / self.settings.rate_hz, emulated)

    def _open_output(self) -> PwmOutput:
        if self.settings.backend == "emulator":
            return open_output(replace(self.settings, backend="sysfs", chip=self._emulated_chip()))
        return open_output(self.settings)

    def _emulated_chip(self) -> str:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="fish_rudder_")
            PwmChipEmulator(Path(self._folder.name) / "pwmchip0", self.settings.channel)
        return str(Path(self._folder.name) / "pwmchip0")

    def _on_command(self, message: JointState) -> None:
        alpha = joint_value(message, "rudder", "position")
        self._driver.command(math.nan if alpha is None else alpha)  # counted as rejected

    def _is_new(self, stamp: Time) -> bool:
        return abs(self.clock.now() - self.clock.of(stamp)) < FORGOTTEN_S

    def _on_state(self) -> None:
        self._driver.armed(bool(self._arming.armed))

    def _say_trouble(self) -> None:
        self.publish(self._trouble, String(data=self._driver.trouble))

    def _cycle(self) -> None:
        self.log_events(self._driver.step())


def main() -> None:
    """Entry point."""
    run(RudderNode, "rudder")


if __name__ == "__main__":
    main()
