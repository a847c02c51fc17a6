# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""IQUART, the serial protocol of Vertiq modules.

    0x55 | length u8 | type u8 | subtype u8 | object << 2 | access u8 | data | CRC-16 little-endian

length counts subtype, object/access and data. The CRC (CCITT, polynomial 0x1021, initial 0xFFFF) covers
everything between 0x55 and itself. 0x55 is not escaped, so a 0x55 inside data looks like a start until its
CRC fails.
Source: iq-module-communication-doc, iquart_protocol.rst.
"""

import struct
from binascii import crc_hqx
from dataclasses import dataclass

GET, SET, SAVE, REPLY = 0, 1, 2, 3
START = 0x55
CRC_INITIAL = 0xFFFF
MIN_PAYLOAD = 2  # subtype and object/access
MAX_PAYLOAD = 59  # practical limit of the modules
OVERHEAD = 5  # start, length, type, two bytes of CRC
MAX_MODULE = 63  # six bits


@dataclass(frozen=True)
class Message:
    """One message: register (type, param), access, module id and little-endian data."""

    type: int
    param: int
    access: int
    module: int = 0
    data: bytes = b""


def encode(message: Message) -> bytes:
    """The bytes of a message; ValueError if a field does not fit the frame."""
    if not 0 <= message.module <= MAX_MODULE:
        raise ValueError(f"module id is {message.module}, expected 0 to {MAX_MODULE}")
    length = MIN_PAYLOAD + len(message.data)
    if length > MAX_PAYLOAD:
        raise ValueError(
            f"{len(message.data)} bytes of data, expected at most {MAX_PAYLOAD - MIN_PAYLOAD}"
        )
    body = (
        bytes([length, message.type, message.param, message.module << 2 | message.access])
        + message.data
    )
    return bytes([START]) + body + struct.pack("<H", crc_hqx(body, CRC_INITIAL))


class Parser:
    """Finds messages in a stream of bytes; drops and counts what is none.

    After a failed CRC the search goes on at the byte after the false start, so that a stray 0x55 never costs
    the good message behind it.
    """

    def __init__(self) -> None:
        self.crc_errors = 0
        self.skipped_bytes = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Message]:
        """Take bytes in pieces of any size; return the messages that are complete now."""
        self._buffer += data
        messages = []
        while self._find_start():
            size = self._buffer[1] + OVERHEAD
            if len(self._buffer) < size:
                break
            message = self._take(size)
            if message is not None:
                messages.append(message)
        return messages

    def flush(self) -> list[Message]:
        """End of a burst: give up the incomplete message and return complete ones that hid behind a false
        start.
        """
        messages = []
        while self._buffer:
            self._skip(1)
            messages += self.feed(b"")
        return messages

    @property
    def pending(self) -> int:
        """Bytes of an incomplete message."""
        return len(self._buffer)

    def _find_start(self) -> bool:
        """Bring a start byte with a possible length to the front; False if more bytes are needed."""
        while True:
            start = self._buffer.find(START)
            self._skip(len(self._buffer) if start < 0 else start)
            if len(self._buffer) < 2:
                return False
            if MIN_PAYLOAD <= self._buffer[1] <= MAX_PAYLOAD:
                return True
            self._skip(1)

    def _take(self, size: int) -> Message | None:
        body = bytes(self._buffer[1 : size - 2])
        (crc,) = struct.unpack("<H", self._buffer[size - 2 : size])
        if crc_hqx(body, CRC_INITIAL) != crc:
            self.crc_errors += 1
            self._skip(1)
            return None
        del self._buffer[:size]
        return Message(body[1], body[2], body[3] & 3, body[3] >> 2, body[4:])

    def _skip(self, count: int) -> None:
        self.skipped_bytes += count
        del self._buffer[:count]
