# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A filter's memory of one robot's motion, kept up to date from odometry messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Generic, TypeVar

from fish_control.line_of_sight import Motion

# s, a longer gap between odometry messages, or a longer step back, restarts the filters
LONGEST_STEP = 0.1
State = TypeVar("State")


class MotionObserver(Generic[State]):
    """Feeds `advance(state, motion, dt)` with the time dt [s] that has passed between stamps."""

    def __init__(self, start: State, advance: Callable[[State, Motion, float], State]) -> None:
        self._start, self._advance = start, advance
        self._time: float | None = None
        self.state = start

    def add(self, time: float, motion: Motion) -> None:
        """Take in odometry stamped `time` [s]; what repeats a stamp or comes a little out of order is ignored."""
        dt = math.inf if self._time is None else time - self._time
        if abs(dt) > LONGEST_STEP:  # a gap, or a clock that was set back
            self.state = self._start
        elif dt > 0.0:
            self.state = self._advance(self.state, motion, dt)
        else:
            return
        self._time = time
