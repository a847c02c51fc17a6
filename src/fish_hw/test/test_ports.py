# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Ports: serial on pseudo-terminals, I2C with the real smbus2, the interrupt line on real descriptors, and devices that belong
to another user.
"""

import errno
import fcntl
import os
import pty
import struct
import subprocess
import sys
import tempfile
import termios
import time
import tty
from pathlib import Path

import pytest
import smbus2.smbus2
from fakes import FakeKernel

from fish_hw.devices.bno085 import Bno085
from fish_hw.emulators.bno085 import Bno085Emulator
from fish_hw.emulators.pwm import Pca9685Emulator
from fish_hw.transport.gpio_line import InterruptLine
from fish_hw.transport.i2c_bus import KernelI2c
from fish_hw.transport.interfaces import PortUnavailable, TransportError
from fish_hw.transport.serial_port import SerialPort

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
def terminal():
    master, slave = pty.openpty()
    tty.setraw(master)
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for descriptor in (master, slave):
        try:
            os.close(descriptor)
        except OSError:
            continue  # a test pulled the plug


def test_bytes_both_ways(terminal):
    master, name = terminal
    port = SerialPort(name, 115200)
    port.write(b"\x55\x00\x0a\x0d\xff")
    assert os.read(master, 10) == b"\x55\x00\x0a\x0d\xff"
    os.write(master, b"\x03\x13\x11\xff")
    assert port.read(1.0) == b"\x03\x13\x11\xff"
    assert port.read(0.0) == b""
    port.close()


def test_port_has_the_speed_that_was_asked_for(terminal):
    master, name = terminal
    port = SerialPort(name, 57600)
    _, _, cflag, _, read_speed, write_speed, _ = termios.tcgetattr(master)
    assert (read_speed, write_speed) == (termios.B57600, termios.B57600)
    assert cflag & (termios.CSIZE | termios.PARENB | termios.CSTOPB) == termios.CS8  # 8N1
    port.close()


def test_port_is_exclusive(terminal):
    _, name = terminal
    port = SerialPort(name, 115200)
    with pytest.raises(PortUnavailable, match="another program holds it"):
        SerialPort(name, 115200)
    port.close()
    SerialPort(name, 115200).close()


def test_absent_port_lists_the_others():
    with pytest.raises(
        PortUnavailable,
        match="cannot open serial port /dev/ttyX9: there is no such port; available: ",
    ):
        SerialPort("/dev/ttyX9", 115200)


def test_something_that_is_no_serial_port():
    with pytest.raises(
        PortUnavailable, match="cannot open serial port /dev/null: it is no serial port"
    ):
        SerialPort("/dev/null", 115200)


def test_peer_gone(terminal):
    master, name = terminal
    port = SerialPort(name, 115200)
    os.close(master)
    with pytest.raises(TransportError, match="read failed"):
        port.read(0.1)
    with pytest.raises(TransportError, match="write failed"):
        port.write(b"x")
    port.close()


def test_closed_port(terminal):
    port = SerialPort(terminal[1], 115200)
    port.close()
    port.close()
    with pytest.raises(TransportError):
        port.read(0.1)
    with pytest.raises(TransportError):
        port.write(b"x")


def test_missing_library_of_the_serial_port_names_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(PortUnavailable, match=r"pip install pyserial.*apt install python3-serial"):
        SerialPort("/dev/ttyX9", 115200)


@pytest.fixture
def kernel(monkeypatch, tmp_path):
    kernel = FakeKernel({0x4A: Bno085Emulator(), 0x40: Pca9685Emulator()})
    monkeypatch.setattr(smbus2.smbus2, "ioctl", kernel.ioctl)
    kernel.path = tmp_path / "i2c-1"
    kernel.path.write_text("")
    return kernel


def test_real_driver_reads_samples_through_smbus2(kernel):
    bus = KernelI2c(str(kernel.path))
    bno = Bno085(bus, 0x4A, 1000, sleep=lambda _: None)
    assert str(bno.start()) == "part 10003608 version 3.2.7 build 370"
    samples = [s for _ in range(50) for s in bno.poll()]
    assert samples
    assert samples[0].acceleration[2] == pytest.approx(9.8, abs=0.5)
    assert set(kernel.messages_per_transfer) == {1}  # never a repeated start


def test_long_reads_are_not_cut(kernel):
    bus = KernelI2c(str(kernel.path))
    kernel.devices[0x4A].push(0, bytes(range(250)) * 2)
    assert bus.read(0x4A, 504)[4:] == bytes(range(250)) * 2


@pytest.mark.parametrize(
    "code", [errno.EREMOTEIO, errno.ETIMEDOUT, errno.EIO, errno.EAGAIN, errno.ENXIO]
)
def test_bus_errors(kernel, code):
    bus = KernelI2c(str(kernel.path))
    kernel.fault = lambda: code
    with pytest.raises(TransportError, match="device 0x4a"):
        bus.read(0x4A, 4)


def test_nobody_at_the_address(kernel):
    with pytest.raises(TransportError, match="device 0x4b"):
        KernelI2c(str(kernel.path)).write(0x4B, b"x")


def test_closed_bus(kernel):
    bus = KernelI2c(str(kernel.path))
    bus.close()
    bus.close()
    with pytest.raises(TransportError):
        bus.read(0x4A, 4)


def test_missing_bus_names_it():
    with pytest.raises(
        PortUnavailable, match="cannot open I2C bus /dev/i2c-77: there is no such bus"
    ):
        KernelI2c("/dev/i2c-77")


def test_missing_library_of_i2c_names_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(PortUnavailable, match=r"pip install smbus2.*apt install python3-smbus2"):
        KernelI2c("/dev/i2c-1")


def iowr(number: int, size: int) -> int:
    """_IOWR(0xB4, number, size bytes) of asm-generic/ioctl.h."""
    return 3 << 30 | size << 16 | 0xB4 << 8 | number


GET_LINE, GET_VALUES = iowr(0x07, 592), iowr(0x0E, 16)  # linux/gpio.h, version 2


class Kernel:
    """Gives the read end of a pipe as the line; edges are written into the other end."""

    def __init__(self) -> None:
        self.reader, self.writer = os.pipe()
        self.value = 1
        self.request = b""
        self.refuse: int | None = None
        self.chip_descriptor = -1

    def ioctl(self, descriptor, number, argument):
        if self.refuse is not None:
            raise OSError(self.refuse, os.strerror(self.refuse))
        if number == GET_LINE:
            self.chip_descriptor = descriptor
            self.request = bytes(argument)
            argument[588:592] = struct.pack("<i", self.reader)
        elif number == GET_VALUES:
            argument[0:8] = struct.pack("<Q", self.value)
        else:
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))

    def fall(self, time_ns: int) -> None:
        os.write(self.writer, struct.pack("<QIIII24x", time_ns, 2, 17, 1, 1))


@pytest.fixture
def gpio(monkeypatch, tmp_path):
    gpio = Kernel()
    monkeypatch.setattr(fcntl, "ioctl", gpio.ioctl)
    gpio.chip = tmp_path / "gpiochip0"
    gpio.chip.write_text("")
    yield gpio
    os.close(gpio.writer)


def test_request_asks_for_one_input_with_falling_edges(gpio):
    line = InterruptLine(str(gpio.chip), 17)
    assert len(gpio.request) == 592
    offset, flags, lines = (
        struct.unpack_from(f, gpio.request, at)[0]
        for f, at in (("<I", 0), ("<Q", 288), ("<I", 560))
    )
    assert (offset, lines) == (17, 1)
    assert flags == 0x4 | 0x20 | 0x100  # input, falling edge, pull-up
    assert gpio.request[256:263] == b"fish_hw"
    line.close()
    line.close()
    for descriptor in (gpio.chip_descriptor, gpio.reader):
        with pytest.raises(OSError):
            os.fstat(descriptor)


def test_newest_edge_counts(gpio):
    line = InterruptLine(str(gpio.chip), 17)
    assert line.wait(0.0) is None
    gpio.fall(5_000_000_000)
    gpio.fall(5_010_000_000)
    start = time.monotonic()
    assert line.wait(8.0) == pytest.approx(5.01)
    assert time.monotonic() - start < 6.0  # a second edge is not waited for
    assert line.wait(0.0) is None
    line.close()


def test_wait_ends(gpio):
    line = InterruptLine(str(gpio.chip), 17)
    start = time.monotonic()
    assert line.wait(0.05) is None
    assert 0.04 < time.monotonic() - start < 2.0
    line.close()


def test_level(gpio):
    line = InterruptLine(str(gpio.chip), 17)
    assert not line.is_low()
    gpio.value = 0
    assert line.is_low()
    gpio.refuse = errno.ENODEV
    with pytest.raises(TransportError, match="gpiochip0 line 17"):
        line.is_low()
    line.close()
    with pytest.raises(TransportError):
        line.wait(0.0)


def test_busy_line_and_absent_chip(gpio):
    gpio.refuse = errno.EBUSY
    with pytest.raises(PortUnavailable, match="line 17: another program holds the line"):
        InterruptLine(str(gpio.chip), 17)
    with pytest.raises(PortUnavailable, match="there is no such chip"):
        InterruptLine("/dev/gpiochip99", 17)
    os.close(gpio.reader)


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


def enterable_by_others(path: Path) -> bool:
    """Whether a user without rights may enter a folder and all above it."""
    return all(folder.stat().st_mode & 0o001 for folder in (path, *path.parents))


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
    if os.geteuid() == 0 and not enterable_by_others(Path(sys.prefix)):
        pytest.skip(f"{sys.prefix} lies in a folder that other users cannot enter")
    program = OPEN.format(nobody=NOBODY, call=call.format(path=str(path)))
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert result.stderr == ""
    (line,) = result.stdout.splitlines()
    assert str(path) in line
    assert "no permission" in line
    assert f"group {group}" in line
