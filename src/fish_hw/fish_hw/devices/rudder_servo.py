# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rudder servo: rudder angle to pulse, with limits, slew rate, arming state and watchdog.

    pulse = centre_us + us_per_rad sign (alpha + trim), within min_us .. max_us

alpha > 0 steers left. The servo has no feedback: the angle that is reported is the one that was sent.
"""

import math
from dataclasses import dataclass

from fish_hw.settings.rudder import RudderSettings

LONGEST_STEP_S = 0.05  # a cycle that was late must not earn a larger jump


@dataclass
class RudderCounters:
    """Commands that were not followed as given."""

    rejected: int = 0
    clamped: int = 0


class RudderServo:
    """Turns commands into pulses; times in s of one monotonic clock."""

    def __init__(self, settings: RudderSettings) -> None:
        self.counters = RudderCounters()
        self.alpha = 0.0  # rad, sent last
        self._settings = settings
        self._target = 0.0
        self._target_time: float | None = None
        self._armed_time: float | None = None
        self._last_step: float | None = None

    def command(self, alpha: float, now: float) -> None:
        """Take a commanded angle [rad]; numbers that are none are rejected and counted."""
        if not math.isfinite(alpha):
            self.counters.rejected += 1
            return
        limit = self._settings.max_angle
        self.counters.clamped += abs(alpha) > limit
        self._target = min(max(alpha, -limit), limit)
        self._target_time = now

    def armed(self, armed: bool, now: float) -> None:
        """Take the word of the arming state's owner."""
        self._armed_time = now if armed else None

    def idle(self, now: float) -> str:
        """Why the rudder does not follow commands; empty if it does."""
        if self._armed_time is None:
            return "disarmed"
        if now - self._armed_time > self._settings.armed_timeout_s:
            return f"no arming/state for {self._settings.armed_timeout_s:g} s"
        if self._target_time is None or now - self._target_time > self._settings.stale_s:
            return f"no command for {self._settings.stale_s:g} s"
        return ""

    def step(self, now: float) -> int:
        """Pulse [ns] of this cycle: towards the command, or to the centre while it is idle."""
        dt = 0.0 if self._last_step is None else min(now - self._last_step, LONGEST_STEP_S)
        self._last_step = now
        target = 0.0 if self.idle(now) else self._target
        most = self._settings.max_rate * dt
        self.alpha += min(max(target - self.alpha, -most), most)
        return self.pulse_ns(self.alpha)

    def centre_ns(self) -> int:
        """Pulse [ns] of alpha = 0; forgets the last angle."""
        self.alpha = 0.0
        return self.pulse_ns(0.0)

    def pulse_ns(self, alpha: float) -> int:
        """Pulse [ns] for a rudder angle [rad], within the mechanical stops."""
        settings = self._settings
        us = settings.centre_us + settings.us_per_rad * settings.sign * (alpha + settings.trim)
        return round(1000 * min(max(us, settings.min_us), settings.max_us))
