# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""IQUART, the serial protocol of Vertiq modules, and the registers of a Vertiq 40-06 (speed firmware) that the rotor needs.

    0x55 | length u8 | type u8 | subtype u8 | object << 2 | access u8 | data | CRC-16 little-endian

length counts subtype, object/access and data. The CRC (CCITT, polynomial 0x1021, initial 0xFFFF) covers
everything between 0x55 and itself. 0x55 is not escaped, so a 0x55 inside data looks like a start until its
CRC fails.
Source: iq-module-communication-doc, iquart_protocol.rst and docs/clients; numbers as in the vendor's client files.
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


@dataclass(frozen=True)
class Register:
    """One entry: address (type, param), struct code of its value ("" for none), name with unit."""

    type: int
    param: int
    format: str
    name: str

    def set(self, module: int, value: float | None = None) -> Message:
        """The message that writes value (None for a register without one)."""
        data = struct.pack("<" + self.format, value) if self.format else b""
        return Message(self.type, self.param, SET, module, data)

    def get(self, module: int) -> Message:
        """The message that asks for the value."""
        return Message(self.type, self.param, GET, module)

    def values(self, data: bytes) -> tuple[float, ...] | None:
        """Numbers in the data of a reply; None if the size is wrong."""
        if len(data) != struct.calcsize("<" + self.format):
            return None
        return struct.unpack("<" + self.format, data)


CTRL_MODE = Register(52, 0, "b", "control mode")
CTRL_COAST = Register(52, 2, "", "coast")
CTRL_VELOCITY = Register(52, 5, "f", "velocity command [rad/s]")
VELOCITY_KP = Register(52, 7, "f", "velocity Kp [V s/rad]")
VELOCITY_KI = Register(52, 8, "f", "velocity Ki [V/rad]")
VELOCITY_KD = Register(52, 9, "f", "velocity Kd [V s^2/rad]")
VELOCITY_FF1 = Register(52, 11, "f", "velocity feed-forward [V s/rad]")
TIMEOUT = Register(52, 15, "f", "timeout [s]")
INPUT_FILTER = Register(52, 16, "I", "command filter [Hz]")
TIMEOUT_MEANING = Register(52, 17, "B", "timeout meaning")
TIMEOUT_BEHAVIOR = Register(52, 18, "B", "timeout behaviour")
TIMEOUT_SONG = Register(52, 19, "B", "timeout song")
OBS_ANGLE = Register(50, 12, "f", "angle [rad], wrapped to +-pi")
OBS_VELOCITY = Register(50, 13, "f", "velocity [rad/s]")
DERATE = Register(50, 41, "i", "derating, 65536 = none")
FAULT_NOW = Register(84, 0, "B", "faults present")
FAULT_EVER = Register(84, 1, "B", "faults since cleared")
FIRMWARE = Register(5, 16, "I", "firmware version")
TELEMETRY = Register(88, 1, "hhhhhhI", "telemetry")

COAST, NO_MODE, BRAKE = 1, -1, 0
RESTING_MODES = (NO_MODE, BRAKE, COAST)
DERATE_NONE = 65536
FAULT_BITS = (
    "logic supply low",
    "input voltage",
    "reference voltage",
    "supply current",
    "motor current",
    "controller temperature",
    "coil temperature",
)
TUNING = (VELOCITY_KP, VELOCITY_KI, VELOCITY_KD, VELOCITY_FF1, INPUT_FILTER, FIRMWARE)


def fault_names(bits: int) -> list[str]:
    """The faults in a FAULT_NOW or FAULT_EVER byte in words."""
    return [name for bit, name in enumerate(FAULT_BITS) if bits >> bit & 1]
