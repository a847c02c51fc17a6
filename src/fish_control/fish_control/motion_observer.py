"""The guidance memory of one robot, kept up to date from odometry messages."""

from __future__ import annotations

import numpy as np

from fish_control.line_of_sight import GuidanceConfig, GuidanceState, Motion, observe

LONGEST_STEP = 0.1  # s, a longer gap between odometry messages restarts the filters


class MotionObserver:
    """Feeds `observe` with the time that has passed between stamps."""

    def __init__(self, config: GuidanceConfig) -> None:
        self._config = config
        self._time: float | None = None
        self.state = GuidanceState()

    def add(self, time: float, motion: Motion) -> None:
        """Take in odometry stamped `time` [s]."""
        dt = 0.0 if self._time is None else time - self._time
        self._time = time
        if 0.0 < dt <= LONGEST_STEP:
            self.state = observe(self.state, motion, dt, self._config, np)
        else:
            self.state = GuidanceState()
