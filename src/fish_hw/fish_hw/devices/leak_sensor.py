# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A leak sensor on a GPIO line: two wires at the hull's lowest place, or a board with a logic output."""

from collections.abc import Callable

from fish_hw.transport.interfaces import DataReady, TransportError

PERIOD_S = 0.05  # s between two looks


class LeakSensor:
    """Looks at the line now and then; a line that cannot be read counts as trouble, not as dry.

    Args:
        open_line: opens the GPIO line.
        wet_is_low: the level that means water.
    """

    def __init__(self, open_line: Callable[[], DataReady], wet_is_low: bool) -> None:
        self._open_line, self._wet_is_low = open_line, wet_is_low
        self._line: DataReady | None = None
        self._next_s = 0.0
        self._trouble = ""

    def trouble(self, now: float) -> str:
        """What speaks against swimming at `now` [s]; empty if the hull is dry."""
        if now >= self._next_s:
            self._next_s = now + PERIOD_S
            self._trouble = self._look()
        return self._trouble

    def close(self) -> None:
        """Give the line back."""
        if self._line is not None:
            self._line.close()
        self._line = None

    def _look(self) -> str:
        try:
            if self._line is None:
                self._line = self._open_line()
            wet = self._line.is_low() is self._wet_is_low
        except TransportError as error:
            self.close()
            return f"leak sensor cannot be read: {error}"
        return "leak: water in the hull" if wet else ""
