# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How many periods of the simulation are due at a moment of real time."""

from __future__ import annotations

import math

ROUNDING = 1e-6  # periods
MAX_LAG = 0.2  # s of real time; a simulation further behind gives up what it missed


class Pacer:
    """Keeps simulated time at `factor` times real time; factor 0 is as fast as possible.

    It is never ahead of real time: stamps from the future look like another clock. A short lag is caught up with; after a
    longer one the lost time is skipped and counted.
    """

    def __init__(self, factor: float, period: float, now: float) -> None:
        self._factor, self._period = factor, period
        self.lost = 0.0  # s of real time skipped
        self.restart(now)

    def restart(self, now: float) -> None:
        """Count from this moment [s]."""
        self._anchor, self._done = now, 0

    def due(self, now: float) -> int:
        """Number of periods to run now; they count as run. Negative never."""
        if self._factor == 0.0:
            return 1
        behind = (
            math.floor((now - self._anchor) * self._factor / self._period + ROUNDING) - self._done
        )
        if behind * self._period > MAX_LAG * max(1.0, self._factor):
            self.lost += behind * self._period / self._factor
            self.restart(now)
            return 0
        self._done += max(0, behind)
        return max(0, behind)
