# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""UART-RVC, the plain 100 Hz output of the BNO085: attitude and acceleration, no gyroscope.

    AA AA | index u8 | yaw, pitch, roll i16 (0.01 deg) | ax, ay, az i16 (milli-g) | 3 reserved | checksum u8

The checksum is the sum of the 16 bytes between the start and itself. At reset the hub sends lines of text.
Source: BNO08X datasheet 1000-3927, section 1.3.5.2.
"""

import math
import struct
from dataclasses import dataclass

START = b"\xaa\xaa"
FRAME_BYTES = 19
RAD_PER_COUNT = math.radians(0.01)
STANDARD_GRAVITY = 9.80665  # m/s^2 per g
PERIOD_S = 0.01  # fixed by the hub


@dataclass(frozen=True)
class RvcMessage:
    """Attitude as yaw, pitch, roll [rad] (applied in this order) and specific force [m/s^2], sensor axes.

    The datasheet contradicts itself on the axes of pitch and roll: see devices/bno085_rvc.
    """

    index: int
    yaw: float
    pitch: float
    roll: float
    acceleration: tuple[float, float, float]


class RvcParser:
    """Finds frames in a stream of bytes; drops and counts what is none."""

    def __init__(self) -> None:
        self.checksum_errors = 0
        self.skipped_bytes = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[RvcMessage]:
        """Take bytes in pieces of any size; return the messages that are complete now."""
        self._buffer += data
        messages = []
        while self._find_start() and len(self._buffer) >= FRAME_BYTES:
            frame = bytes(self._buffer[:FRAME_BYTES])
            if sum(frame[2:-1]) & 0xFF == frame[-1]:
                messages.append(_decode(frame))
                del self._buffer[:FRAME_BYTES]
            else:  # AA AA may occur inside data: go on one byte further
                self.checksum_errors += 1
                self._skip(1)
        return messages

    def _find_start(self) -> bool:
        start = self._buffer.find(START)
        if start >= 0:
            self._skip(start)
            return True
        self._skip(len(self._buffer) - self._buffer.endswith(START[:1]))
        return False

    def _skip(self, count: int) -> None:
        self.skipped_bytes += count
        del self._buffer[:count]


def encode(message: RvcMessage) -> bytes:
    """The bytes of a message, as the hub sends them."""
    angles = [round(angle / RAD_PER_COUNT) for angle in (message.yaw, message.pitch, message.roll)]
    milli_g = [round(1000 * a / STANDARD_GRAVITY) for a in message.acceleration]
    body = struct.pack("<B6h3x", message.index, *angles, *milli_g)
    return START + body + bytes([sum(body) & 0xFF])


def _decode(frame: bytes) -> RvcMessage:
    index, yaw, pitch, roll, *milli_g = struct.unpack_from("<B6h", frame, 2)
    x, y, z = (value * STANDARD_GRAVITY / 1000 for value in milli_g)
    return RvcMessage(
        index, yaw * RAD_PER_COUNT, pitch * RAD_PER_COUNT, roll * RAD_PER_COUNT, (x, y, z)
    )
