# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The PWM output that the settings ask for: one of the kernel, or a PCA9685, sixteen PWM outputs of 12 bits on I2C.

    prescale = round(clock / (4096 f)) - 1,   count = round(pulse / tick),   tick = (prescale + 1) / clock

Source: NXP PCA9685 datasheet, sections 7.3.3 and 7.3.5.
"""

import time
from collections.abc import Callable

from fish_hw.devices.rudder_driver import PwmOutput
from fish_hw.settings import RudderSettings
from fish_hw.transport.i2c_bus import KernelI2c
from fish_hw.transport.interfaces import I2cBus
from fish_hw.transport.sysfs_pwm import SysfsPwm

MODE1, PRESCALE, LED0_ON_L = 0x00, 0xFE, 0x06
SLEEP, AUTO_INCREMENT, RESTART = 0x10, 0x20, 0x80
FULL_OFF = bytes([0x00, 0x00, 0x00, 0x10])
COUNTS = 4096
MIN_PRESCALE, MAX_PRESCALE = 3, 255
OSCILLATOR_START_S = 0.005  # datasheet: 500 us at least

NS_PER_S = 1e9


def prescale(clock_hz: float, pwm_hz: float) -> int:
    """Divider for a repetition rate; ValueError if the chip cannot do it."""
    value = round(clock_hz / (COUNTS * pwm_hz)) - 1
    if not MIN_PRESCALE <= value <= MAX_PRESCALE:
        raise ValueError(
            f"pwm_hz is {pwm_hz}: the PCA9685 would need a divider of {value}, has 3 to 255"
        )
    return value


class Pca9685Pwm:
    """One output of the board: pulses in nanoseconds."""

    def __init__(
        self,
        bus: I2cBus,
        address: int,
        channel: int,
        clock_hz: float,
        pwm_hz: float,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._bus = bus
        self._address = address
        self._register = LED0_ON_L + 4 * channel
        self._prescale = prescale(clock_hz, pwm_hz)
        self._tick_ns = 1e9 * (self._prescale + 1) / clock_hz
        self._sleep = sleep

    def start(self, pulse_ns: int) -> None:
        """Set the rate (possible only asleep), wake up, start the pulses."""
        self._write(MODE1, bytes([0x00]))
        self._write(MODE1, bytes([SLEEP]))
        self._write(PRESCALE, bytes([self._prescale]))
        self._write(MODE1, bytes([0x00]))
        self._sleep(OSCILLATOR_START_S)
        self._write(MODE1, bytes([RESTART | AUTO_INCREMENT]))
        self.set_pulse_ns(pulse_ns)

    def set_pulse_ns(self, pulse_ns: int) -> None:
        """Change the pulse; all four registers in one burst, or the servo would jump."""
        count = min(max(round(pulse_ns / self._tick_ns), 0), COUNTS - 1)
        self._write(self._register, bytes([0x00, 0x00]) + count.to_bytes(2, "little"))

    def stop(self) -> None:
        """Switch the pulses off."""
        self._write(self._register, FULL_OFF)

    def is_running(self) -> bool:
        """False after the board lost its supply: it wakes up asleep, with another rate."""
        return not self._read(MODE1) & SLEEP and self._read(PRESCALE) == self._prescale

    def close(self) -> None:
        """Give the bus back."""
        self._bus.close()

    def _write(self, register: int, data: bytes) -> None:
        self._bus.write(self._address, bytes([register]) + data)

    def _read(self, register: int) -> int:
        self._bus.write(self._address, bytes([register]))
        return self._bus.read(self._address, 1)[0]


def open_output(settings: RudderSettings) -> PwmOutput:
    """Open it; PortUnavailable if it is not there, ValueError for an emulator, which is made elsewhere."""
    if settings.backend == "emulator":
        raise ValueError("backend is 'emulator': there is no output to open")
    if settings.backend == "pca9685":
        bus = KernelI2c(settings.bus)
        return Pca9685Pwm(
            bus, settings.address, settings.channel, settings.pca_clock_hz, settings.pwm_hz
        )
    return SysfsPwm(settings.chip, settings.channel, round(NS_PER_S / settings.pwm_hz))
