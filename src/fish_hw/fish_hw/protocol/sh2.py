# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the BNO085 says on I2C: SHTP, its packets, and SH-2, the messages in them.

SHTP: headers, sequence numbers, fragments.

    length u16 (bit 15: continuation of the previous cargo; header included) | channel u8 | sequence u8 |
    payload

SH-2: feature requests, product id, input reports. An input cargo is 0xFB, base i32 (100 us), then reports. A report is
id, sequence, status, delay, data:

    t = t_read - 100 us * base + 100 us * delay,   delay = (status & 0xFC) << 6 | delay byte

and 0xFA adds to the base. Report lengths depend on the id, so an unknown id ends the cargo.
Source: CEVA 1000-3535 as described by the BNO08X datasheet 1000-3927; SH-2 reference manual 1000-3625, sections 6.5
and 7.2.
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


SET_FEATURE, FEATURE_RESPONSE = 0xFD, 0xFC
PRODUCT_ID_REQUEST, PRODUCT_ID_RESPONSE = 0xF9, 0xF8
COMMAND_RESPONSE = 0xF1
BASE_TIMESTAMP, REBASE = 0xFB, 0xFA
ACCELEROMETER, GYROSCOPE, LINEAR_ACCELERATION = 0x01, 0x02, 0x04
ROTATION_VECTOR, GRAVITY, GAME_ROTATION_VECTOR = 0x05, 0x06, 0x08
RESET_COMMAND = b"\x01"  # on the executable channel
RESET_COMPLETE = b"\x01"  # the hub's answer there
TICK_S = 100e-6
TIMESTAMP_BYTES = 5
OVERFLOW_TICKS = 0x7FFFFFFF
REPORT_HEADER_BYTES = 4  # id, sequence, status, delay


@dataclass(frozen=True)
class Layout:
    """Length of a report in bytes and the fixed-point numbers in it: how many, with how many fraction
    bits.
    """

    length: int
    count: int = 0
    q: int = 0


LAYOUTS = {
    ACCELEROMETER: Layout(10, 3, 8),  # m/s^2
    GYROSCOPE: Layout(10, 3, 9),  # rad/s
    0x03: Layout(10, 3, 4),  # magnetic field, uT
    LINEAR_ACCELERATION: Layout(10, 3, 8),  # m/s^2
    ROTATION_VECTOR: Layout(14, 4, 14),  # quaternion x y z w; accuracy follows
    GRAVITY: Layout(10, 3, 8),  # m/s^2
    0x07: Layout(16),  # uncalibrated gyroscope
    GAME_ROTATION_VECTOR: Layout(12, 4, 14),  # quaternion x y z w, no absolute heading
    0x09: Layout(14, 4, 14),  # geomagnetic rotation vector
    0x13: Layout(6),  # stability
    0x14: Layout(16),  # raw accelerometer
    0x15: Layout(16),  # raw gyroscope
    0x16: Layout(16),  # raw magnetometer
    0x19: Layout(6),  # shake
    0x28: Layout(14, 4, 14),  # AR/VR rotation vector
    0x29: Layout(12, 4, 14),  # AR/VR game rotation vector
    FEATURE_RESPONSE: Layout(17),
    COMMAND_RESPONSE: Layout(16),
    PRODUCT_ID_RESPONSE: Layout(16),
}


@dataclass(frozen=True)
class Report:
    """One measurement: SI values, time on the reader's clock, accuracy 0 (unreliable) to 3 (high)."""

    id: int
    sequence: int
    accuracy: int
    time_s: float
    values: tuple[float, ...]


@dataclass(frozen=True)
class ProductId:
    """Firmware of the hub."""

    part: int
    version: tuple[int, int, int]
    build: int

    def __str__(self) -> str:
        major, minor, patch = self.version
        return f"part {self.part} version {major}.{minor}.{patch} build {self.build}"


@dataclass
class Drops:
    """What could not be read, counted since the start."""

    unknown_reports: int = 0
    truncated_reports: int = 0


def set_feature(report_id: int, interval_us: int) -> bytes:
    """Payload (control channel) that switches a report on with this interval; 0 switches it off."""
    return struct.pack("<BBBHIII", SET_FEATURE, report_id, 0, 0, interval_us, 0, 0)


def product_id_request() -> bytes:
    """Payload (control channel) that asks for the firmware."""
    return bytes([PRODUCT_ID_REQUEST, 0])


def parse_product_id(payload: bytes) -> ProductId | None:
    """Answer to product_id_request, or None if payload is something else."""
    if len(payload) < LAYOUTS[PRODUCT_ID_RESPONSE].length or payload[0] != PRODUCT_ID_RESPONSE:
        return None
    _, _, major, minor, part, build, patch = struct.unpack("<BBBBIIH", payload[:14])
    return ProductId(part, (major, minor, patch), build)


def parse_feature_response(payload: bytes) -> tuple[int, int] | None:
    """(report id, interval in us that the hub really uses), or None if payload is something else."""
    if len(payload) < LAYOUTS[FEATURE_RESPONSE].length or payload[0] != FEATURE_RESPONSE:
        return None
    report_id, _, _, interval_us = struct.unpack("<BBHI", payload[1:9])
    return report_id, interval_us


def parse_reports(payload: bytes, read_time_s: float, drops: Drops) -> list[Report]:
    """Reports of one input cargo; what cannot be read is dropped and counted in drops.

    Args:
        payload: cargo of the report channel, without packet header.
        read_time_s: when the hub announced it.
    """
    reports: list[Report] = []
    base_s: float | None = (
        None  # no report before its time base: a lost first bit of 0xFB must not be guessed
    )
    while payload:
        kind = payload[0]
        if kind in (BASE_TIMESTAMP, REBASE):
            size, base_s = TIMESTAMP_BYTES, _base(payload, read_time_s, base_s)
        else:
            size = LAYOUTS[kind].length if kind in LAYOUTS else 0
        if not size or base_s is None:
            drops.unknown_reports += 1
            return reports
        if len(payload) < size:
            drops.truncated_reports += 1
            return reports
        if kind in LAYOUTS and LAYOUTS[kind].count:
            reports.append(_report(payload, base_s))
        payload = payload[size:]
    return reports


def _base(payload: bytes, read_time_s: float, base_s: float | None) -> float | None:
    """Time base after a base timestamp (before the read) or a rebase (after the present base)."""
    if len(payload) < TIMESTAMP_BYTES:
        return read_time_s if base_s is None else base_s
    ticks = int.from_bytes(payload[1:TIMESTAMP_BYTES], "little", signed=True)
    if ticks == OVERFLOW_TICKS:
        return read_time_s
    if payload[0] == BASE_TIMESTAMP:
        return read_time_s - ticks * TICK_S
    return None if base_s is None else base_s + ticks * TICK_S


def _report(payload: bytes, base_s: float) -> Report:
    kind, sequence, status, delay = payload[:REPORT_HEADER_BYTES]
    layout = LAYOUTS[kind]
    ticks = (status & 0xFC) << 6 | delay
    raw = struct.unpack_from(f"<{layout.count}h", payload, REPORT_HEADER_BYTES)
    values = tuple(value / (1 << layout.q) for value in raw)
    return Report(kind, sequence, status & 3, base_s + ticks * TICK_S, values)
