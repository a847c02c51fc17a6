# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the rotor may do, decided from commands, the arming state and time alone.

    RESTING  coasting; measured, not driven
    RUNNING  follows the command within the limits of speed and acceleration
    STOPPING the robot was disarmed: speed goes to zero in ramp_s, then COASTING
    COASTING coast was said; nothing is sent until the module's own watchdog has had its time, because every
    byte would feed it

Whether the robot is armed is decided elsewhere (fish_node.arming); this is how the rotor obeys.
"""

import math
from dataclasses import dataclass
from enum import Enum

from fish_hw.settings import RotorSettings

AT_REST = 0.5  # rad/s; a ramp that is below has ended, 1/300 of full speed
QUIET_MARGIN_S = 0.1  # silence beyond the module's own timeout
LATE_PERIODS = 1.5  # a cycle that was late must not earn a larger jump of speed than so many
LONGEST_RAMP_STEP_S = 0.05  # on the way to zero a late cycle is made up for


class Phase(Enum):
    """State of the rotor."""

    RESTING = "resting"
    RUNNING = "running"
    STOPPING = "stopping"
    COASTING = "coasting"


@dataclass(frozen=True)
class Action:
    """What to send now: a speed [rad/s] if not None, or coast, and whether the module may be asked
    anything.
    """

    velocity: float | None = None
    coast: bool = False
    ask: bool = False


class RotorGuard:
    """Limits and the way to a stop; all times in s of one monotonic clock.

    Attributes:
        velocity: what was sent last [rad/s].
    """

    def __init__(self, settings: RotorSettings) -> None:
        self.phase = Phase.RESTING
        self.clamped = 0
        self.velocity = 0.0
        self._settings = settings
        self._command = 0.0
        self._ramp = 0.0  # rad/s^2
        self._last_step: float | None = None
        self._quiet_until = 0.0

    def command(self, velocity: float) -> None:
        """Take a commanded speed [rad/s], a finite number."""
        limit = self._settings.max_velocity
        self.clamped += abs(velocity) > limit
        self._command = min(max(velocity, -limit), limit)

    def cut(self, now: float) -> None:
        """Stop without a ramp, for a module that is not to be trusted with one; the caller coasts it at once."""
        self._last_step = None
        self._coast(now)

    def step(self, now: float, armed: bool) -> Action:
        """The action of this cycle."""
        since = 0.0 if self._last_step is None else max(now - self._last_step, 0.0)
        self._last_step = now
        if self.phase is Phase.COASTING:
            return self._wait(now)
        if self.phase is Phase.RUNNING and not armed:
            self._begin_ramp()
        if self.phase is Phase.STOPPING:
            return self._ramp_down(now, min(since, LONGEST_RAMP_STEP_S))
        if not armed:
            return Action(ask=True)
        if since > self._settings.module_timeout_s:  # the module coasted by itself meanwhile
            self.velocity = 0.0
        return self._follow(min(since, LATE_PERIODS / self._settings.rate_hz))

    def _follow(self, dt: float) -> Action:
        self.phase = Phase.RUNNING
        most = self._settings.max_acceleration * dt
        change = self._command - self.velocity
        self.velocity += min(max(change, -most), most)
        return Action(velocity=self.velocity, ask=True)

    def _begin_ramp(self) -> None:
        self.phase = Phase.STOPPING
        shortest = abs(self.velocity) / self._settings.max_acceleration
        self._ramp = abs(self.velocity) / max(self._settings.ramp_s, shortest, 1e-3)

    def _ramp_down(self, now: float, dt: float) -> Action:
        left = abs(self.velocity) - self._ramp * dt
        if left <= AT_REST:
            return self._coast(now)
        self.velocity = math.copysign(left, self.velocity)
        return Action(velocity=self.velocity)

    def _coast(self, now: float) -> Action:
        self.velocity = 0.0
        self.phase = Phase.COASTING
        self._quiet_until = now + self._settings.module_timeout_s + QUIET_MARGIN_S
        return Action(coast=True)

    def _wait(self, now: float) -> Action:
        if now < self._quiet_until:
            return Action()
        self.phase = Phase.RESTING
        return Action(ask=True)
