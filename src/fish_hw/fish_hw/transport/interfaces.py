# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The kinds of port that devices are written against, and what can go wrong with a port."""

from typing import Protocol


class TransportError(Exception):
    """A port failed while it was in use: unplugged, bus error, time-out."""


class PortUnavailable(TransportError):
    """A port cannot be opened; the message names the port, the reason and the alternatives."""


def unavailable(port: str, reason: str, alternatives: list[str]) -> PortUnavailable:
    """PortUnavailable with one line: what was asked for, why not, what there is instead."""
    found = ", ".join(alternatives) if alternatives else "none found"
    return PortUnavailable(f"cannot open {port}: {reason}; available: {found}")


class ByteStream(Protocol):
    """A serial port, a pseudo-terminal or recorded bytes."""

    def write(self, data: bytes) -> None:
        """Send all of data or raise TransportError."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """Whatever arrives first within timeout_s; empty on time-out; TransportError if the peer is gone."""
        ...

    def close(self) -> None:
        """Give the port back; may be called twice."""
        ...


class DataReady(Protocol):
    """A line that a device pulls low while it has data."""

    def wait(self, timeout_s: float) -> float | None:
        """Time [s, monotonic clock] of the newest falling edge within timeout_s; None if none came."""
        ...

    def is_low(self) -> bool:
        """Whether the device has data now."""
        ...

    def close(self) -> None:
        """Give the line back; may be called twice."""
        ...


class I2cBus(Protocol):
    """An I2C bus with plain writes and plain reads, one message each (no repeated start)."""

    def write(self, address: int, data: bytes) -> None:
        """Send data to the device at the 7-bit address or raise TransportError."""
        ...

    def read(self, address: int, count: int) -> bytes:
        """Read exactly count bytes or raise TransportError."""
        ...

    def close(self) -> None:
        """Give the bus back; may be called twice."""
        ...
