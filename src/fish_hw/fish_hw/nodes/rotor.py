# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `rotor`: the Vertiq module that turns the rotor.

It owns the arming state of the robot (fish_node.nodes.arming): what must stop the rotor is decided where the rotor is
driven, without a way through another process.

In:  joint_command (joint rotor: velocity [rad/s]), rudder/trouble (std_msgs/String: empty, or why the rudder does not
     work), odometry/filtered, camera/pose, operator/deadman, operator/estop, arming/disarm,
     arming/pause
Out: joint_states (joint rotor: position [rad], velocity [rad/s]; stamped when measured), battery_state,
     arming/state, /diagnostics
Services: arm (std_srvs/SetBool: true arms, false disarms), ~/clear_faults (std_srvs/Trigger)
"""

import math
from pathlib import Path

from rclpy.qos import QoSProfile
from sensor_msgs.msg import BatteryState, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fish_hw.devices.leak_sensor import LeakSensor
from fish_hw.devices.rotor_driver import RUDDER, RotorDriver
from fish_hw.devices.vertiq import RotorTelemetry
from fish_hw.emulators.vertiq import VertiqEmulator
from fish_hw.nodes.device_node import DeviceNode, joint_value, run
from fish_hw.settings import RotorSettings
from fish_hw.transport.gpio_line import InterruptLine
from fish_hw.transport.interfaces import ByteStream
from fish_hw.transport.serial_port import SerialPort
from fish_node.nodes.arming import ArmingServer
from fish_node.nodes.message_bytes import MessageBytes, mark
from fish_node.nodes.robot_clock import timer_clock
from fish_node.rivals import Rivals

SECOND_S = 1.0  # between two words of the battery, and two looks for other commanders


def require_real_time(simulated: bool, port: str) -> None:
    """Raise ValueError for a real motor in simulated time, in which no time-out passes while /clock stands still."""
    emulated = port == "emulator" or Path(port).resolve().is_relative_to("/dev/pts")
    if simulated and not emulated:
        raise ValueError(
            f"use_sim_time is true and port is {port}: a real motor needs real time, expected use_sim_time false, or the "
            "port emulator or that of a fake robot"
        )


class RotorNode(DeviceNode):
    """Commands in, measurements out; what is allowed is decided in RotorDriver."""

    def __init__(self) -> None:
        super().__init__("rotor", RotorSettings)
        require_real_time(self.clock.simulated, self.settings.port)
        self._joint_states = self.create_publisher(JointState, "joint_states", 10)
        moves = JointState(name=["rotor"], position=[mark(0)], velocity=[mark(1)])
        moves.header.frame_id = self.settings.frame_prefix + self.settings.frame_id
        self._joint_bytes = MessageBytes(moves, 2)
        self._battery_state = self.create_publisher(BatteryState, "battery_state", 10)
        self._emulator = (
            VertiqEmulator(self.settings.module_id, clock=self.clock.now)
            if self.settings.port == "emulator"
            else None
        )
        self._driver = RotorDriver(
            self.settings, self._open_port, self.clock.now, self._leak_sensor(), self._open_at
        )
        self._telemetry: RotorTelemetry | None = None
        self._arming = ArmingServer(self, self._driver.arming, self.settings, self.clock.now)
        commands = self.create_subscription(
            JointState, "joint_command", self._on_command, QoSProfile(depth=1)
        )
        self._commanders = Rivals(
            commands.topic_name, self.count_publishers, self.get_logger().warning
        )
        self.create_subscription(String, "rudder/trouble", self._on_rudder, QoSProfile(depth=1))
        self.create_service(Trigger, "~/clear_faults", self._on_clear_faults)
        self.create_timer(SECOND_S, self._on_second, clock=timer_clock(self))
        self.use(self._driver, self._cycle, 1.0 / self.settings.rate_hz, self._emulator is not None)

    def _open_port(self) -> ByteStream:
        return self._open_at(self.settings.baud)

    def _open_at(self, baud: int) -> ByteStream:
        port = self.settings.port if self._emulator is None else self._emulator.port
        return SerialPort(port, baud)

    def _leak_sensor(self) -> LeakSensor | None:
        settings = self.settings
        if settings.leak_line < 0:
            return None
        return LeakSensor(
            lambda: InterruptLine(settings.leak_chip, settings.leak_line),
            settings.leak_level == "low",
        )

    def _on_command(self, message: JointState) -> None:
        rudder = joint_value(message, "rudder", "position")
        if rudder is not None and not abs(rudder) <= math.pi:
            self._driver.arming.disarm(
                f"commanded rudder is {rudder:g} rad, expected {math.pi:.3g} rad at most"
            )
        self._driver.command(joint_value(message, "rotor", "velocity"))

    def _on_rudder(self, message: String) -> None:
        trouble = f"rudder: {message.data}" if message.data else ""
        self._driver.arming.heard(RUDDER, self.clock.now(), trouble)

    def _on_clear_faults(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        self._driver.clear_faults()
        response.success = self._driver.connected
        response.message = (
            "the module is asked as soon as it may be"
            if response.success
            else "the module is not connected"
        )
        return response

    def _cycle(self) -> None:
        cycle = self._driver.step()
        self._arming.say_change()
        self.log_events(cycle.events)
        if cycle.telemetry is not None and cycle.telemetry.volts is not None:
            self._telemetry = cycle.telemetry
        if cycle.sample is not None:
            stamp = self.stamp(cycle.sample.time_s)
            numbers = cycle.sample.angle, cycle.sample.velocity
            self.publish(self._joint_states, self._joint_bytes(stamp, numbers))

    def _on_second(self) -> None:
        self._commanders.warning()
        self._say_battery()

    def _say_battery(self) -> None:
        telemetry, self._telemetry = self._telemetry, None  # a value is not said twice
        if telemetry is None or telemetry.volts is None or telemetry.amps is None:
            return
        message = BatteryState(
            voltage=telemetry.volts,
            current=-telemetry.amps,  # negative while discharging
            temperature=math.nan,
            charge=math.nan,
            capacity=math.nan,
            design_capacity=math.nan,
            percentage=math.nan,
            power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
            power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
            present=True,
        )
        message.header.stamp = self.get_clock().now().to_msg()
        self.publish(self._battery_state, message)


def main() -> None:
    """Entry point."""
    run(RotorNode, "rotor")


if __name__ == "__main__":
    main()
