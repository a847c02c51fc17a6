# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `imu`: BNO085.

Out: imu/data (orientation without absolute heading, angular velocity [rad/s], specific force [m/s^2];
     base_link axes, stamped when measured), /diagnostics
"""

from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu

from fish_hw.devices.bno085_rvc import BAUD
from fish_hw.devices.imu_driver import ImuDriver
from fish_hw.devices.imu_sample import ImuSample
from fish_hw.emulators.bno085 import Bno085Emulator
from fish_hw.emulators.i2c_bus import I2cBusEmulator
from fish_hw.nodes.device_node import DeviceNode, run
from fish_hw.settings import ImuSettings
from fish_hw.transport.gpio_line import InterruptLine
from fish_hw.transport.i2c_bus import KernelI2c
from fish_hw.transport.interfaces import DataReady, I2cBus
from fish_hw.transport.serial_port import SerialPort
from fish_hw.transport.unix_socket import PREFIX, SocketI2c
from fish_node.nodes.message_bytes import MessageBytes, mark


class ImuNode(DeviceNode):
    """Samples out; reading and judging them is in ImuDriver."""

    def __init__(self) -> None:
        super().__init__("imu", ImuSettings)
        settings = self.settings
        self._data = self.create_publisher(Imu, "imu/data", QoSProfile(depth=10))
        self._period_s = 1.0 / settings.rate_hz
        self._driver = ImuDriver(
            settings,
            self._open_bus,
            self._open_line,
            lambda: SerialPort(settings.port, BAUD),
            self.clock.now,
        )
        self._bytes = self._message_bytes()
        emulated = settings.interface == "i2c" and settings.bus == "emulator"
        waits = (
            settings.interface == "rvc" or settings.int_line >= 0
        )  # a step then lasts until there is data
        self.use(self._driver, self._cycle, 0.0 if waits else self._period_s, emulated)

    def _open_bus(self) -> I2cBus:
        if self.settings.bus == "emulator":
            return I2cBusEmulator({self.settings.address: Bno085Emulator(self.clock.now)})
        if self.settings.bus.startswith(PREFIX):
            return SocketI2c(self.settings.bus)
        return KernelI2c(self.settings.bus)

    def _open_line(self) -> DataReady | None:
        if self.settings.int_line < 0:
            return None
        return InterruptLine(self.settings.int_chip, self.settings.int_line)

    def _cycle(self) -> None:
        cycle = self._driver.step(self._period_s)
        self.log_events(cycle.events)
        for sample in cycle.samples:
            self.publish(self._data, self._message(sample))

    def _message_bytes(self) -> MessageBytes:
        """Frame and covariances (REP 145) are the same in every message."""
        message = Imu()
        message.header.frame_id = self.settings.frame_prefix + self.settings.frame_id
        message.orientation_covariance = diagonal(self.settings.orientation_stdev)
        message.angular_velocity_covariance = diagonal(self.settings.angular_velocity_stdev)
        message.linear_acceleration_covariance = diagonal(self.settings.linear_acceleration_stdev)
        q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
        q.x, q.y, q.z, q.w = map(mark, range(4))
        w.x, w.y, w.z = map(mark, range(4, 7))
        a.x, a.y, a.z = map(mark, range(7, 10))
        return MessageBytes(message, 10)

    def _message(self, sample: ImuSample) -> bytes:
        numbers = (*sample.orientation, *sample.angular_velocity, *sample.acceleration)
        return self._bytes(self.stamp(sample.time_s), numbers)


def diagonal(stddev: float) -> list[float]:
    """Covariance (9, row-major) of three independent axes."""
    v = stddev**2
    return [v, 0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0, v]


def main() -> None:
    """Entry point."""
    run(ImuNode, "imu")


if __name__ == "__main__":
    main()
