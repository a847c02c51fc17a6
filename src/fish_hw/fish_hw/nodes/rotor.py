"""Node `rotor`: the Vertiq module that turns the rotor.

In:  joint_command (joint rotor: velocity [rad/s])
Out: joint_states (joint rotor: position [rad], velocity [rad/s]; stamped when measured), battery_state,
     /diagnostics
Services: ~/enable (std_srvs/SetBool: false stops until true), ~/clear_faults (std_srvs/Trigger)
"""

import math

from rclpy.qos import QoSProfile
from sensor_msgs.msg import BatteryState, JointState
from std_srvs.srv import SetBool, Trigger

from fish_hw.devices.rotor_driver import RotorDriver
from fish_hw.devices.vertiq import RotorSample, RotorTelemetry
from fish_hw.emulators.vertiq import VertiqEmulator
from fish_hw.nodes.device_node import DeviceNode, run
from fish_hw.nodes.joint_message import joint_value
from fish_hw.settings.rotor import RotorSettings
from fish_hw.transport.interfaces import ByteStream
from fish_hw.transport.serial_port import SerialPort

BATTERY_PERIOD_S = 1.0


class RotorNode(DeviceNode):
    """Commands in, measurements out; what is allowed is decided in RotorDriver."""

    def __init__(self) -> None:
        super().__init__("rotor", RotorSettings)
        self._joint_states = self.create_publisher(JointState, "joint_states", 10)
        self._battery_state = self.create_publisher(BatteryState, "battery_state", 10)
        self._emulator = (
            VertiqEmulator(self.settings.module_id) if self.settings.port == "emulator" else None
        )
        self._driver = RotorDriver(self.settings, self._open_port)
        self._telemetry: RotorTelemetry | None = None
        self.create_subscription(JointState, "joint_command", self._on_command, QoSProfile(depth=1))
        self.create_service(SetBool, "~/enable", self._on_enable)
        self.create_service(Trigger, "~/clear_faults", self._on_clear_faults)
        self.create_timer(BATTERY_PERIOD_S, self._on_battery)
        self.use(self._driver, self._cycle, 1.0 / self.settings.rate_hz, self._emulator is not None)

    def _open_port(self) -> ByteStream:
        port = self.settings.port if self._emulator is None else self._emulator.port
        return SerialPort(port, self.settings.baud)

    def _on_command(self, message: JointState) -> None:
        velocity = joint_value(message, "rotor", "velocity")
        self._driver.command(math.nan if velocity is None else velocity)  # counted as rejected

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if request.data:
            self._driver.enable()
        else:
            self._driver.stop("stopped by the operator")
        response.success = True
        response.message = "enabled" if request.data else "stopping"
        return response

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
        self.log_events(cycle.events)
        if cycle.telemetry is not None and cycle.telemetry.volts is not None:
            self._telemetry = cycle.telemetry
        if cycle.sample is not None:
            self.publish(self._joint_states, self._joint_message(cycle.sample))

    def _joint_message(self, sample: RotorSample) -> JointState:
        message = JointState(name=["rotor"], position=[sample.angle], velocity=[sample.velocity])
        message.header.stamp = self.stamp(sample.time_s)
        message.header.frame_id = self.settings.frame_id
        return message

    def _on_battery(self) -> None:
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
