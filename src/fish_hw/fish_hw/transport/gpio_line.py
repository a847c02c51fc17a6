# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One interrupt line through the kernel's GPIO character device; edges carry the kernel's time.

Source: linux/gpio.h, version 2 of the interface (kernel 5.10 or later); sizes and numbers were compared with
that header.
"""

import errno
import fcntl
import os
import select
import struct
from glob import glob

from fish_hw.transport.interfaces import TransportError, unavailable

GET_LINE = 0xC250B407  # GPIO_V2_GET_LINE_IOCTL
GET_VALUES = 0xC010B40E  # GPIO_V2_LINE_GET_VALUES_IOCTL
REQUEST = struct.Struct(
    "<64I 32s Q I 20x 240x I I 20x i"
)  # offsets, consumer, flags, num_attrs, lines, buffer, fd
EVENT = struct.Struct("<Q I I I I 24x")  # timestamp_ns (monotonic), id, offset, seqno, line_seqno
VALUES = struct.Struct("<QQ")  # bits, mask
INPUT, FALLING_EDGE, PULL_UP = 1 << 2, 1 << 5, 1 << 8
NS = 1e-9
REASONS = {
    errno.ENOENT: "there is no such chip",
    errno.EACCES: "no permission (add the user to group gpio or dialout)",
    errno.EISDIR: "it is a folder",
    errno.ENOTTY: "it is no GPIO chip",
    errno.EBUSY: "another program holds the line",
    errno.EINVAL: "the chip has no such line",
}


class InterruptLine:
    """An input that its device pulls low while it has data.

    Args:
        chip: GPIO chip, /dev/gpiochip0.
        line: number of the line on that chip (on a Raspberry Pi the BCM number).
    """

    def __init__(self, chip: str, line: int) -> None:
        self.name = f"{chip} line {line}"
        try:
            self._descriptor = request_line(chip, line)
        except OSError as error:
            reason = REASONS.get(error.errno or 0, str(error))
            others = sorted(path for path in glob("/dev/gpiochip*") if path != chip)
            raise unavailable(self.name, reason, others) from error

    def wait(self, timeout_s: float) -> float | None:
        """Time [s, monotonic clock] of the newest falling edge within timeout_s; None if none came."""
        newest = None
        try:
            while select.select([self._descriptor], [], [], timeout_s if newest is None else 0.0)[
                0
            ]:
                data = os.read(self._descriptor, EVENT.size)
                newest = EVENT.unpack(data)[0] * NS
        except (OSError, ValueError, struct.error) as error:
            raise TransportError(f"{self.name}: {error}") from error
        return newest

    def is_low(self) -> bool:
        """Whether the device has data now."""
        values = bytearray(VALUES.pack(0, 1))
        try:
            fcntl.ioctl(self._descriptor, GET_VALUES, values)
        except OSError as error:
            raise TransportError(f"{self.name}: {error}") from error
        return not VALUES.unpack(values)[0] & 1

    def close(self) -> None:
        """Give the line back; may be called twice."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1


def request_line(chip: str, line: int) -> int:
    """Descriptor of an input line with pull-up that tells falling edges; OSError if the kernel refuses."""
    flags = INPUT | FALLING_EDGE | PULL_UP
    request = bytearray(REQUEST.pack(line, *[0] * 63, b"fish_hw", flags, 0, 1, 0, 0))
    descriptor = os.open(chip, os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.ioctl(descriptor, GET_LINE, request)
    finally:
        os.close(descriptor)
    return int(REQUEST.unpack(request)[-1])
