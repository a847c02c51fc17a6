# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The PWM output that the settings ask for."""

from fish_hw.devices.pca9685 import Pca9685Pwm
from fish_hw.devices.rudder_driver import PwmOutput
from fish_hw.settings.rudder import RudderSettings
from fish_hw.transport.i2c_bus import KernelI2c
from fish_hw.transport.sysfs_pwm import SysfsPwm

NS_PER_S = 1e9


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
