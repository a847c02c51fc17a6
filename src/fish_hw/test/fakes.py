# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the tests share: waiting with an end, recorded bytes as a port, and stand-ins for the kernel.

FakeKernel is its I2C driver, so that the real smbus2 runs; refuse_as_sysfs_does has its rules for PWM files.
"""

import ctypes
import errno
import os
import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
import smbus2.smbus2

READ = 1  # I2C_M_RD


def wait_until(condition: Callable[[], bool], timeout_s: float = 5.0) -> bool:
    """Whether condition came true within timeout_s."""
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.002)
    return condition()


class RecordedStream:
    """ByteStream: every read returns the next chunk, an exception in the list is raised, writes are kept.

    Reads past the end return nothing, as a silent line does.
    """

    def __init__(self, chunks: Iterable[bytes | Exception] = ()) -> None:
        self.chunks = deque(chunks)
        self.written: list[bytes] = []
        self.closed = False

    def write(self, data: bytes) -> None:
        """Keep data for the test to look at."""
        self.written.append(bytes(data))

    def read(self, timeout_s: float) -> bytes:
        """The next recorded chunk."""
        if not self.chunks:
            return b""
        chunk = self.chunks.popleft()
        if isinstance(chunk, Exception):
            raise chunk
        return chunk

    def close(self) -> None:
        """Note that the port was given back."""
        self.closed = True


class FakeKernel:
    """Serves I2C_RDWR with the emulated devices; `fault` may return an errno."""

    def __init__(self, devices: dict) -> None:
        self.devices = devices
        self.fault: Callable[[], int | None] = lambda: None
        self.messages_per_transfer: list[int] = []

    def ioctl(self, descriptor, request, argument=0, *_rest):
        if descriptor is None:
            raise TypeError(
                "argument must be an int, or have a fileno() method."
            )  # as fcntl.ioctl says
        code = self.fault()
        if code is not None:
            raise OSError(code, os.strerror(code))
        if request == smbus2.smbus2.I2C_FUNCS:
            argument.value = 0x0EFF0001
            return 0
        if request != smbus2.smbus2.I2C_RDWR:
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        self.messages_per_transfer.append(argument.nmsgs)
        for i in range(argument.nmsgs):
            self._message(argument.msgs[i])
        return argument.nmsgs

    def _message(self, message) -> None:
        device = self.devices.get(message.addr)
        if device is None:
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        if message.flags & READ:
            ctypes.memmove(message.buf, device.read(message.len), message.len)
        else:
            device.write(ctypes.string_at(message.buf, message.len))


def refuse_as_sysfs_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels before mid-2024 refuse every write that leaves period 0 or a pulse longer than the period.

    All refuse another polarity of a channel that is on.
    """
    plain = Path.write_text

    def write_text(path: Path, text: str) -> int:
        if path.name in ("period", "duty_cycle", "enable", "polarity") and path.exists():
            state = {
                name: int((path.parent / name).read_text())
                for name in ("period", "duty_cycle", "enable")
            }
            if path.name == "polarity" and state["enable"]:
                raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
            if path.name != "polarity":
                state[path.name] = int(text)
            if state["period"] == 0 or state["duty_cycle"] > state["period"]:
                raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        return plain(path, text)

    monkeypatch.setattr(Path, "write_text", write_text)
