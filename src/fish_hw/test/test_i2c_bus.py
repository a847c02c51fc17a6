# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The I2C transport with the real smbus2 on a stand-in for the kernel."""

import errno
import sys

import pytest
import smbus2.smbus2
from fake_kernel import FakeKernel

from fish_hw.devices.bno085 import Bno085
from fish_hw.emulators.bno085 import Bno085Emulator
from fish_hw.emulators.pwm import Pca9685Emulator
from fish_hw.transport.i2c_bus import KernelI2c
from fish_hw.transport.interfaces import PortUnavailable, TransportError


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


def test_missing_library_names_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(PortUnavailable, match=r"pip install smbus2.*apt install python3-smbus2"):
        KernelI2c("/dev/i2c-1")
