# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What all drivers share about a device that comes and goes: its error, its state for diagnostics, when to try it again,
and what the log says of it.
"""

from dataclasses import dataclass, field

OK, WARN, ERROR = 0, 1, 2  # as in diagnostic_msgs/DiagnosticStatus

FIRST_WAIT_S = 0.5
LONGEST_WAIT_S = 5.0


class DeviceError(Exception):
    """The port works, the device behind it does not answer or refuses a setting."""


@dataclass(frozen=True)
class Status:
    """Level, one line, and named values."""

    level: int
    message: str
    values: dict[str, object] = field(default_factory=dict)


class Loss(str):
    """An event that tells of a lost device: logged as an error."""


class Doubt(str):
    """An event that tells of a device whose values cannot be right: logged as a warning."""


class Link:
    """The way to one device: doubling waits between attempts, from FIRST_WAIT_S to LONGEST_WAIT_S.

    A device that can be opened need not work: only works(), said at its first data, ends an absence. Until then
    the waits grow and a reason that repeats is not said again.
    """

    def __init__(self, name: str) -> None:
        self.attempts = 0
        self.trouble = "not connected yet"
        self._name = name
        self._lost = False
        self._next = 0.0
        self._wait = FIRST_WAIT_S

    def due(self, now: float) -> bool:
        """Whether the next attempt may be made."""
        return now >= self._next

    def lose(self, reason: str, now: float) -> list[str]:
        """An attempt failed, or the device was lost; the event, unless it was said before."""
        self.attempts += 1
        self._lost = True
        self._next = now + self._wait
        self._wait = min(2 * self._wait, LONGEST_WAIT_S)
        said, self.trouble = self.trouble, reason
        return [Loss(reason)] if reason != said else []

    def works(self) -> list[str]:
        """Data came from the device; the event, if it was lost before."""
        self._wait = FIRST_WAIT_S
        self.trouble = ""
        lost, self._lost = self._lost, False
        return [f"{self._name} connected again"] if lost else []
