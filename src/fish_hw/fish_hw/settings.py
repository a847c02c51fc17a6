# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One frozen dataclass per node: its fields are the ROS parameters, checked when it is made.

Each error names the field, its value and what is allowed.
"""

import math
from dataclasses import dataclass

from fish_node.arming import ArmingSettings
from fish_node.frames import require_frame, require_frame_prefix

CYCLES = 3  # that a command or an answer may be late without anything being stopped
BACKENDS = ("sysfs", "pca9685", "emulator")
INTERFACES = ("i2c", "rvc")


def require_range(name: str, value: float, low: float, high: float) -> None:
    """ValueError unless low <= value <= high (NaN fails)."""
    if not (math.isfinite(value) and low <= value <= high):
        raise ValueError(f"{name} is {value}, expected {low} to {high}")


def require_choice(name: str, value: object, choices: tuple[object, ...]) -> None:
    """ValueError unless value is one of choices."""
    if value not in choices:
        raise ValueError(
            f"{name} is {value!r}, expected one of {', '.join(repr(c) for c in choices)}"
        )


@dataclass(frozen=True)
class RotorSettings(ArmingSettings):
    """Vertiq module, its limits, and what disarms the robot."""

    port: str = "/dev/serial0"  # serial device, or "emulator"
    baud: int = 115200  # bit/s; must be what the module is set to
    module_id: int = 0  # 0 to 63
    startup_timeout_s: float = (
        0.0  # s to wait for the module at start, then the node ends with an error; 0: without end
    )
    rate_hz: float = 100.0  # Hz, commands to the module and joint_states
    reply_timeout_s: float = 0.008  # s to wait for the answers of one cycle
    sign: int = 1  # -1 if positive speed of the motor turns the rotor clockwise seen from above
    max_velocity: float = 160.0  # rad/s; full throttle at 2 Hz needs 150.8
    max_acceleration: float = 2200.0  # rad/s^2; full throttle at 2 Hz needs 1895
    stale_s: float = 0.2  # s without a command until the robot is disarmed; 3 / rate_hz at least
    ramp_s: float = (
        0.1  # s from the last speed to zero, then coast; longer if max_acceleration says so
    )
    module_timeout_s: float = (
        0.25  # s without any byte until it coasts by itself; 3 / rate_hz at least
    )
    answer_timeout_s: float = 0.15  # s without measured speed until the module is given up
    telemetry_timeout_s: float = (
        0.15  # s without battery, temperatures or faults until the robot is disarmed
    )
    rudder_timeout_s: float = (
        0.2  # s without a word of node rudder until the robot is disarmed; 0: no rudder
    )
    leak_chip: str = "/dev/gpiochip0"  # GPIO chip of the leak sensor
    leak_line: int = -1  # line of the leak sensor (BCM number), with pull-up; -1 no sensor
    leak_level: str = "low"  # low | high: level of the line when the sensor is wet
    battery_cells: int = 4  # cells in series
    cell_warn_v: float = 3.5  # V per cell, filtered
    cell_stop_v: float = 3.3  # V per cell, filtered: the robot is disarmed
    cell_over_v: float = (
        4.3  # V per cell, two answers in a row: disarmed, braking energy has nowhere to go
    )
    battery_filter_s: float = 0.4  # s, the rotor's load ripples at 4 Hz
    temperature_warn_c: float = 70.0  # deg C, coil or controller
    temperature_stop_c: float = 85.0  # deg C, coil or controller: the robot is disarmed
    frame_id: str = "base_link"  # of joint_states
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        super().__post_init__()
        require_frame("frame_id", self.frame_id)
        require_frame_prefix(self.frame_prefix)
        require_range("baud", self.baud, 9600, 3_000_000)
        require_range("module_id", self.module_id, 0, 63)
        require_range("startup_timeout_s", self.startup_timeout_s, 0.0, 3600.0)
        require_range("rate_hz", self.rate_hz, 20.0, 200.0)
        shortest_s = round(CYCLES / self.rate_hz, 4)
        require_range("reply_timeout_s", self.reply_timeout_s, 0.001, 0.2)
        require_choice("sign", self.sign, (1, -1))
        require_range("max_velocity", self.max_velocity, 0.0, 500.0)
        require_range("max_acceleration", self.max_acceleration, 1.0, 1e4)
        require_range("stale_s", self.stale_s, shortest_s, 1.0)
        require_range("ramp_s", self.ramp_s, 0.0, 1.0)
        require_range("module_timeout_s", self.module_timeout_s, max(shortest_s, 0.05), 2.0)
        require_range("answer_timeout_s", self.answer_timeout_s, shortest_s, 2.0)
        require_range("telemetry_timeout_s", self.telemetry_timeout_s, 0.1, 10.0)
        require_range("rudder_timeout_s", self.rudder_timeout_s, 0.0, 5.0)
        require_range("leak_line", self.leak_line, -1, 511)
        require_choice("leak_level", self.leak_level, ("low", "high"))
        require_range("battery_cells", self.battery_cells, 1, 6)
        require_range("cell_stop_v", self.cell_stop_v, 0.0, 5.0)
        require_range("cell_warn_v", self.cell_warn_v, self.cell_stop_v, 5.0)
        require_range("cell_over_v", self.cell_over_v, self.cell_warn_v, 6.0)
        require_range("battery_filter_s", self.battery_filter_s, 0.0, 60.0)
        require_range("temperature_warn_c", self.temperature_warn_c, 0.0, 150.0)
        require_range("temperature_stop_c", self.temperature_stop_c, self.temperature_warn_c, 150.0)


@dataclass(frozen=True)
class RudderSettings:
    """Servo, its geometry and limits, and where its pulses come from."""

    backend: str = "sysfs"  # sysfs | pca9685 | emulator
    chip: str = "/sys/class/pwm/pwmchip0"  # sysfs: folder of the PWM chip
    bus: str = "/dev/i2c-1"  # pca9685: I2C bus
    address: int = 0x40  # pca9685: 7-bit address
    channel: int = 0  # of the chip or board
    pca_clock_hz: float = 25e6  # Hz, real clock of the board (measure the pulses and correct)
    pwm_hz: float = 50.0  # Hz, repetition of the pulses
    startup_timeout_s: float = (
        0.0  # s to wait for the output at start, then the node ends with an error; 0: without end
    )
    rate_hz: float = 100.0  # Hz, updates of the pulse
    sign: int = 1  # -1 if longer pulses steer right
    centre_us: float = 1500.0  # us, pulse that centres the servo horn
    us_per_rad: float = 573.0  # us/rad; 900 us for 90 deg of a usual servo
    trim: float = 0.0  # rad, added to alpha: rudder angle at which the tail is straight
    min_us: float = 1000.0  # us, mechanical stop
    max_us: float = 2000.0  # us, mechanical stop
    max_angle: float = 0.8  # rad, limit of alpha
    max_rate: float = 6.0  # rad/s, slew limit of alpha
    stale_s: float = 0.25  # s without a command until it centres and disarms the robot
    armed_timeout_s: float = 0.2  # s without arming/state until it centres and disarms the robot
    off_at_exit: bool = (
        True  # pulses off after centring; some digital servos hold their place all the same
    )

    def __post_init__(self) -> None:
        require_choice("backend", self.backend, BACKENDS)
        require_range("address", self.address, 0x03, 0x77)
        require_range("channel", self.channel, 0, 15)
        require_range("pca_clock_hz", self.pca_clock_hz, 20e6, 30e6)
        require_range("pwm_hz", self.pwm_hz, 40.0, 333.0)
        require_range("startup_timeout_s", self.startup_timeout_s, 0.0, 3600.0)
        require_range("rate_hz", self.rate_hz, 20.0, 200.0)
        require_choice("sign", self.sign, (1, -1))
        require_range("min_us", self.min_us, 400.0, 2600.0)
        require_range("max_us", self.max_us, self.min_us, 2600.0)
        require_range("centre_us", self.centre_us, self.min_us, self.max_us)
        require_range("us_per_rad", self.us_per_rad, 100.0, 2000.0)
        require_range("trim", self.trim, -0.5, 0.5)
        require_range("max_angle", self.max_angle, 0.0, 1.6)
        require_range("max_rate", self.max_rate, 0.1, 50.0)
        require_range("stale_s", self.stale_s, 0.02, 2.0)
        require_range("armed_timeout_s", self.armed_timeout_s, 0.1, 2.0)


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


@dataclass(frozen=True)
class CameraSettings:
    """USB camera: device, picture, fixed exposure against glare, calibration."""

    device: str = (
        "/dev/video0"  # V4L2 device, video file (played in a loop), unix:FILE, or "emulator"
    )
    startup_timeout_s: float = (
        0.0  # s to wait for the camera at start, then the node ends with an error; 0: without end
    )
    width: int = 1280  # px
    height: int = 720  # px
    rate_hz: float = 30.0  # Hz
    exposure: int = -1  # V4L2 units of 100 us; -1 automatic
    focus: int = -1  # V4L2 units; -1 automatic
    white_balance_k: int = -1  # K; -1 automatic
    exposure_delay_s: float = 0.0  # s from the middle of the exposure to the driver's time stamp
    reopen_s: float = 1.0  # s without a picture until the camera is opened again
    jpeg_quality: int = 85  # 1 to 100, only where the camera does not send JPEG itself
    publish_raw: bool = False  # also camera/image_raw (2.8 MB a frame)
    calibration_file: str = ""  # YAML of camera_calibration; empty: camera_info without calibration
    frame_id: str = "overhead_optical"  # of pictures and camera_info
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        require_frame("frame_id", self.frame_id)
        require_frame_prefix(self.frame_prefix)
        require_range("startup_timeout_s", self.startup_timeout_s, 0.0, 3600.0)
        require_range("width", self.width, 16, 8192)
        require_range("height", self.height, 16, 8192)
        require_range("rate_hz", self.rate_hz, 1.0, 240.0)
        require_range("exposure", self.exposure, -1, 100_000)
        require_range("focus", self.focus, -1, 1023)
        require_range("white_balance_k", self.white_balance_k, -1, 10_000)
        require_range("exposure_delay_s", self.exposure_delay_s, 0.0, 0.5)
        require_range("reopen_s", self.reopen_s, 0.1, 60.0)
        require_range("jpeg_quality", self.jpeg_quality, 1, 100)


@dataclass(frozen=True)
class FakeRobotSettings:
    """Where the devices are, and what they are like."""

    folder: str = "/tmp/fake_robot"  # folder of the devices, made if it is not there
    rate_hz: float = 100.0  # Hz, of the motion that the simulator is given
    seed: int = 0  # of the noise that faults make

    def __post_init__(self) -> None:
        if not self.folder:
            raise ValueError("folder is '', expected a folder for the devices")
        require_range("rate_hz", self.rate_hz, 20.0, 200.0)
        require_range("seed", self.seed, 0, 2**31 - 1)
