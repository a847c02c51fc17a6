# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An I2C bus of the kernel by smbus2, one plain message per call."""

import errno
from glob import glob
from types import ModuleType
from typing import Any

from fish_hw.transport.interfaces import PortUnavailable, TransportError, unavailable

REASONS = {
    errno.ENOENT: "there is no such bus (enable it: dtparam=i2c_arm=on)",
    errno.EACCES: "no permission (add the user to group i2c)",
    errno.EISDIR: "it is a folder",
    errno.ENOTTY: "it is no I2C bus",
    errno.EBUSY: "another program holds it",
}


def import_smbus2() -> ModuleType:
    """The smbus2 module, or PortUnavailable that says how to install it."""
    try:
        import smbus2
    except ImportError as error:
        raise PortUnavailable(
            "I2C needs smbus2: pip install smbus2==0.6.1, or apt install python3-smbus2"
        ) from error
    return smbus2


class KernelI2c:
    """I2cBus on /dev/i2c-N.

    Uses I2C_RDWR with a single message per transfer: SMBus block calls stop at 32 bytes and a combined
    transfer would insert the repeated start that the BNO085 forbids.
    """

    def __init__(self, bus: str) -> None:
        self._smbus2 = import_smbus2()
        self.bus = bus
        try:
            self._bus: Any = self._smbus2.SMBus(bus)
        except OSError as error:
            reason = REASONS.get(error.errno or 0, str(error))
            others = sorted(path for path in glob("/dev/i2c-*") if path != bus)
            raise unavailable(f"I2C bus {bus}", reason, others) from error

    def write(self, address: int, data: bytes) -> None:
        """One write message."""
        self._transfer(self._smbus2.i2c_msg.write(address, data), address)

    def read(self, address: int, count: int) -> bytes:
        """One read message of exactly count bytes."""
        message = self._smbus2.i2c_msg.read(address, count)
        self._transfer(message, address)
        return bytes(message)

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

    def _transfer(self, message: Any, address: int) -> None:
        try:
            self._bus.i2c_rdwr(message)
        except (
            OSError,
            TypeError,
        ) as error:  # TypeError: the bus has been closed, its descriptor is None
            raise TransportError(f"I2C bus {self.bus}, device 0x{address:02x}: {error}") from error
