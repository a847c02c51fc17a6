# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Devices that belong to another user: one line with the device, the path and what to do.

Each device is opened by a process that has given up the rights of root.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

NOBODY = 65534
OPEN = """
import os
from fish_hw.settings import CameraSettings
from fish_hw.transport.interfaces import PortUnavailable
from fish_hw.transport.gpio_line import InterruptLine
from fish_hw.transport.i2c_bus import KernelI2c
from fish_hw.transport.serial_port import SerialPort
from fish_hw.transport.sysfs_pwm import SysfsPwm
from fish_hw.transport.video_capture import VideoCapture
import serial, smbus2
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid({nobody})
    os.setuid({nobody})
try:
    {call}
except PortUnavailable as error:
    print(error)
"""
DEVICES = {
    "serial port": ("SerialPort({path!r}, 115200)", "dialout"),
    "I2C bus": ("KernelI2c({path!r})", "i2c"),
    "GPIO": ("InterruptLine({path!r}, 17)", "gpio"),
    "PWM channel": ("SysfsPwm({path!r}, 0, 20_000_000, sleep=lambda _: None)", "gpio"),
    "PWM export": ("SysfsPwm({path!r}, 1, 20_000_000, sleep=lambda _: None)", "gpio"),
    "camera": ("VideoCapture(CameraSettings(device={path!r}))", "video"),
}


@pytest.fixture
def folder():
    """One that everybody may enter, as /dev."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def foreign_file(path: Path) -> None:
    """A file that its owner alone may use; without root the owner may not use it either."""
    path.write_text("0\n")
    path.chmod(0o600 if os.geteuid() == 0 else 0o000)


@pytest.mark.parametrize("device", DEVICES)
def test_a_foreign_device_is_one_line_with_its_path_and_the_group(folder, device):
    call, group = DEVICES[device]
    path = folder / "device"
    if device.startswith("PWM"):
        (path / "pwm0").mkdir(parents=True)
        for name in ("export", "pwm0/period", "pwm0/duty_cycle", "pwm0/enable"):
            foreign_file(path / name)
    else:
        foreign_file(path)
    program = OPEN.format(nobody=NOBODY, call=call.format(path=str(path)))
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert result.stderr == ""
    (line,) = result.stdout.splitlines()
    assert str(path) in line
    assert "no permission" in line
    assert f"group {group}" in line
