# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""SHTP, the packet layer of the BNO085: headers, sequence numbers, fragments.

    length u16 (bit 15: continuation of the previous cargo; header included) | channel u8 | sequence u8 |
    payload

Source: CEVA 1000-3535 as described by the BNO08X datasheet 1000-3927 and the SH-2 reference manual 1000-3625.
"""

import struct
from dataclasses import dataclass

HEADER_BYTES = 4
CONTINUATION = 0x8000
LENGTH_FAILED = 0xFFFF  # the peripheral does not answer for itself
MAX_CHANNEL = 5
MAX_LENGTH = 32766

COMMAND, EXECUTABLE, CONTROL, REPORTS, WAKE_REPORTS, GYRO_ROTATION = range(6)


@dataclass(frozen=True)
class Header:
    """The four bytes in front of each packet; length includes them."""

    length: int
    channel: int
    sequence: int
    continuation: bool

    @property
    def empty(self) -> bool:
        """The hub has nothing to say."""
        return self.length == 0


@dataclass(frozen=True)
class Cargo:
    """A complete message of one channel."""

    channel: int
    sequence: int
    payload: bytes


def parse_header(data: bytes) -> Header | None:
    """Header of at least four bytes, or None when no hub would send it (failed hub, noise)."""
    length, channel, sequence = struct.unpack("<HBB", data[:HEADER_BYTES])
    if length == LENGTH_FAILED:
        return None
    size = length & ~CONTINUATION
    if size == 0:
        return Header(0, channel, sequence, False)
    if channel > MAX_CHANNEL or not HEADER_BYTES <= size <= MAX_LENGTH:
        return None
    return Header(size, channel, sequence, bool(length & CONTINUATION))


class Writer:
    """Frames payloads and counts the sequence numbers, one per channel."""

    def __init__(self) -> None:
        self._sequence = [0] * (MAX_CHANNEL + 1)

    def frame(self, channel: int, payload: bytes) -> bytes:
        """One unfragmented packet (the hub does not accept fragments)."""
        sequence = self._sequence[channel]
        self._sequence[channel] = (sequence + 1) & 0xFF
        return struct.pack("<HBB", HEADER_BYTES + len(payload), channel, sequence) + payload


class Reassembler:
    """Joins packets to cargoes; counts fragments without a beginning and gaps in the sequence."""

    def __init__(self) -> None:
        self.orphans = 0
        self.sequence_gaps = 0
        self._last: dict[int, int] = {}
        self._open: dict[
            int, tuple[int, bytearray]
        ] = {}  # channel: total payload size, bytes so far

    def feed(self, header: Header, body: bytes) -> Cargo | None:
        """Take one packet (body without header); return the cargo if it is complete."""
        self._check_sequence(header)
        if header.continuation and header.channel not in self._open:
            self.orphans += 1
            return None
        if not header.continuation:
            self.orphans += header.channel in self._open  # a cargo began and never ended
            self._open[header.channel] = (header.length - HEADER_BYTES, bytearray())
        total, payload = self._open[header.channel]
        payload += body
        if len(payload) < total:
            return None
        del self._open[header.channel]
        return Cargo(header.channel, header.sequence, bytes(payload[:total]))

    def reset(self) -> None:
        """Forget fragments and sequence numbers: the hub has restarted."""
        self._last.clear()
        self._open.clear()

    def _check_sequence(self, header: Header) -> None:
        last = self._last.get(header.channel)
        if last is not None and not header.continuation and header.sequence != (last + 1) & 0xFF:
            self.sequence_gaps += 1
        self._last[header.channel] = header.sequence
