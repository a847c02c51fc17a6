# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An I2C bus of emulated devices."""

import errno
import os
from collections.abc import Callable
from typing import Protocol

from fish_hw.transport.interfaces import TransportError


class I2cDevice(Protocol):
    """What sits at an address."""

    def write(self, data: bytes) -> None:
        """A write message."""
        ...

    def read(self, count: int) -> bytes:
        """A read message."""
        ...


class I2cBusEmulator:
    """I2cBus with devices by address; `fault` may return an errno to fail a transfer with."""

    def __init__(self, devices: dict[int, I2cDevice]) -> None:
        self.devices = devices
        self.fault: Callable[[], int | None] = lambda: None
        self.closed = False

    def write(self, address: int, data: bytes) -> None:
        """To the device at address."""
        self._device(address).write(data)

    def read(self, address: int, count: int) -> bytes:
        """From the device at address."""
        return self._device(address).read(count)

    def close(self) -> None:
        """Note that the bus was given back."""
        self.closed = True

    def _device(self, address: int) -> I2cDevice:
        code = self.fault()
        if code is None and address not in self.devices:
            code = errno.EREMOTEIO
        if code is not None:
            raise TransportError(f"emulated I2C bus, device 0x{address:02x}: {os.strerror(code)}")
        return self.devices[address]
