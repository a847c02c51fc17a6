# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stamps of a clock that was set back, told from stragglers."""

from __future__ import annotations

ENOUGH = 4  # stale stamps in a row; stragglers are fewer, and not in their own order


class StaleStamps:
    """Counts stamps that increase among themselves, all before the newest one seen."""

    def __init__(self) -> None:
        self._last, self._count = 0.0, 0

    def set_back(self, time: float, newest: float) -> bool:
        """Whether a stamp [s] with those before it says that the clock was set back; newest: of all so far [s]."""
        in_order = self._count > 0 and time > self._last
        self._last = time
        if time > newest:
            self._count = 0
        else:
            self._count = self._count + 1 if in_order else 1
        return self._count >= ENOUGH
