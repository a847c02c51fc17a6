# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The interrupt line on a stand-in for the kernel: real descriptors, replaced ioctl."""

import errno
import fcntl
import os
import struct
import time

import pytest

from fish_hw.transport.gpio_line import InterruptLine
from fish_hw.transport.interfaces import PortUnavailable, TransportError


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
def kernel(monkeypatch, tmp_path):
    kernel = Kernel()
    monkeypatch.setattr(fcntl, "ioctl", kernel.ioctl)
    kernel.chip = tmp_path / "gpiochip0"
    kernel.chip.write_text("")
    yield kernel
    os.close(kernel.writer)


def test_request_asks_for_one_input_with_falling_edges(kernel):
    line = InterruptLine(str(kernel.chip), 17)
    assert len(kernel.request) == 592
    offset, flags, lines = (
        struct.unpack_from(f, kernel.request, at)[0]
        for f, at in (("<I", 0), ("<Q", 288), ("<I", 560))
    )
    assert (offset, lines) == (17, 1)
    assert flags == 0x4 | 0x20 | 0x100  # input, falling edge, pull-up
    assert kernel.request[256:263] == b"fish_hw"
    line.close()
    line.close()
    for descriptor in (kernel.chip_descriptor, kernel.reader):
        with pytest.raises(OSError):
            os.fstat(descriptor)


def test_newest_edge_counts(kernel):
    line = InterruptLine(str(kernel.chip), 17)
    assert line.wait(0.0) is None
    kernel.fall(5_000_000_000)
    kernel.fall(5_010_000_000)
    start = time.monotonic()
    assert line.wait(8.0) == pytest.approx(5.01)
    assert time.monotonic() - start < 6.0  # a second edge is not waited for
    assert line.wait(0.0) is None
    line.close()


def test_wait_ends(kernel):
    line = InterruptLine(str(kernel.chip), 17)
    start = time.monotonic()
    assert line.wait(0.05) is None
    assert 0.04 < time.monotonic() - start < 2.0
    line.close()


def test_level(kernel):
    line = InterruptLine(str(kernel.chip), 17)
    assert not line.is_low()
    kernel.value = 0
    assert line.is_low()
    kernel.refuse = errno.ENODEV
    with pytest.raises(TransportError, match="gpiochip0 line 17"):
        line.is_low()
    line.close()
    with pytest.raises(TransportError):
        line.wait(0.0)


def test_busy_line_and_absent_chip(kernel):
    kernel.refuse = errno.EBUSY
    with pytest.raises(PortUnavailable, match="line 17: another program holds the line"):
        InterruptLine(str(kernel.chip), 17)
    with pytest.raises(PortUnavailable, match="there is no such chip"):
        InterruptLine("/dev/gpiochip99", 17)
    os.close(kernel.reader)
