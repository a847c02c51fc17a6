# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the rudder node."""

from dataclasses import dataclass

from fish_hw.settings.checks import require_choice, require_range

BACKENDS = ("sysfs", "pca9685", "emulator")


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
    stale_s: float = 0.25  # s without a command until the rudder goes to the centre
    armed_timeout_s: float = 0.2  # s without arming/state until the rudder goes to the centre
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
