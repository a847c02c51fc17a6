"""Node `rudder`: the servo that bends the tail.

In:  joint_command (joint rudder: position = alpha [rad], positive steers left)
Out: servo pulses, /diagnostics
"""

import math
import tempfile
from dataclasses import replace
from pathlib import Path

from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from fish_hw.devices.rudder_driver import PwmOutput, RudderDriver
from fish_hw.devices.rudder_output import open_output
from fish_hw.emulators.pwm_chip import PwmChipEmulator
from fish_hw.nodes.device_node import DeviceNode, run
from fish_hw.nodes.joint_message import joint_value
from fish_hw.settings.rudder import RudderSettings


class RudderNode(DeviceNode):
    """Commands in, pulses out; limits and watchdog are in RudderServo."""

    def __init__(self) -> None:
        super().__init__("rudder", RudderSettings)
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._driver = RudderDriver(self.settings, self._open_output)
        self.create_subscription(JointState, "joint_command", self._on_command, QoSProfile(depth=1))
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

    def _cycle(self) -> None:
        self.log_events(self._driver.step())


def main() -> None:
    """Entry point."""
    run(RudderNode, "rudder")


if __name__ == "__main__":
    main()
