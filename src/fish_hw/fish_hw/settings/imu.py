# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the IMU node."""

import math
from dataclasses import dataclass

from fish_hw.settings.checks import require_choice, require_range
from fish_node.frames import require_frame, require_frame_prefix

INTERFACES = ("i2c", "rvc")


@dataclass(frozen=True)
class ImuSettings:
    """BNO085: how it is wired, how it sits in the hull, how well it measures.

    The mounting angles turn sensor axes into base_link axes: yaw, then pitch, then roll (z, y, x),
    right-handed.
    """

    interface: str = "i2c"  # i2c | rvc (serial, attitude only: rates are differences)
    bus: str = "/dev/i2c-1"  # i2c: bus, unix:FILE of a fake robot, or "emulator"
    address: int = 0x4A  # i2c: 0x4A or 0x4B
    int_chip: str = "/dev/gpiochip0"  # i2c: GPIO chip of the interrupt line
    int_line: int = (
        -1
    )  # i2c: line that H_INTN is wired to (BCM number); -1 not wired: time stamps up to 10 ms late
    port: str = "/dev/ttyUSB0"  # rvc: serial device
    startup_timeout_s: float = (
        0.0  # s to wait for the sensor at start, then the node ends with an error; 0: without end
    )
    rate_hz: float = 100.0  # Hz, asked of the sensor (rvc: 100 always)
    watchdog_s: float = (
        1.0  # s without a sample, or with frozen values, until the sensor is started again
    )
    mount_roll: float = 0.0  # rad
    mount_pitch: float = 0.0  # rad
    mount_yaw: float = 0.0  # rad
    orientation_stdev: float = 0.044  # rad, game rotation vector: 2.5 deg
    angular_velocity_stdev: float = 0.054  # rad/s, 3.1 deg/s worst case
    linear_acceleration_stdev: float = 0.3  # m/s^2
    frame_id: str = "imu_link"  # of imu/data
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        require_frame("frame_id", self.frame_id)
        require_frame_prefix(self.frame_prefix)
        require_choice("interface", self.interface, INTERFACES)
        require_choice("address", self.address, (0x4A, 0x4B))
        require_range("startup_timeout_s", self.startup_timeout_s, 0.0, 3600.0)
        require_range("rate_hz", self.rate_hz, 10.0, 200.0)
        require_range("int_line", self.int_line, -1, 511)
        require_range("watchdog_s", self.watchdog_s, 0.1, 60.0)
        for name in ("mount_roll", "mount_pitch", "mount_yaw"):
            require_range(name, getattr(self, name), -math.pi, math.pi)
        for name in ("orientation_stdev", "angular_velocity_stdev", "linear_acceleration_stdev"):
            require_range(name, getattr(self, name), 1e-6, 10.0)
