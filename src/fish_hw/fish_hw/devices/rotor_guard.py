"""What the rotor may do, decided from commands and time alone.

    RESTING  coasting; measured, not driven
    RUNNING  follows the command within the limits of speed and acceleration
    STOPPING the command is gone: speed goes to zero in ramp_s, then COASTING
    COASTING coast was said; nothing is sent until the module's own watchdog has had its time, because every
    byte would feed it

A stop is latched: what ends it is the setting `resume`, or the operator alone if the operator asked for it.
A node that starts is latched too, except with resume "auto".
"""

import math
from dataclasses import dataclass
from enum import Enum

from fish_hw.settings.rotor import RotorSettings

AT_REST = 0.5  # rad/s; commands below count as rest, 1/300 of full speed
QUIET_MARGIN_S = 0.1  # silence beyond the module's own timeout
LONGEST_STEP_S = 0.05  # a cycle that was late must not earn a larger jump of speed


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
    """Watchdog, limits and latch; all times in s of one monotonic clock."""

    def __init__(self, settings: RotorSettings) -> None:
        self.phase = Phase.RESTING
        self.latched = settings.resume != "auto"
        self.reason = "not enabled yet" if self.latched else ""
        self.rejected = 0
        self.clamped = 0
        self._settings = settings
        self._command = 0.0
        self._command_time: float | None = None
        self._rest_since: float | None = None
        self._velocity = 0.0  # what was sent last
        self._ramp = 0.0  # rad/s^2
        self._last_step: float | None = None
        self._quiet_until = 0.0
        self._held = False

    def command(self, velocity: float, now: float) -> None:
        """Take a commanded speed [rad/s]; numbers that are none are rejected and counted."""
        if not math.isfinite(velocity):
            self.rejected += 1
            return
        gap = self.command_age(now) > self._settings.stale_s
        if abs(velocity) > AT_REST:
            self._rest_since = None
        elif gap or self._rest_since is None:
            self._rest_since = now
        limit = self._settings.max_velocity
        self.clamped += abs(velocity) > limit
        self._command = min(max(velocity, -limit), limit)
        self._command_time = now

    def enable(self) -> None:
        """The operator ends a stop."""
        self.latched = self._held = False
        self.reason = ""

    def stop(self, reason: str, hold: bool = False) -> None:
        """Stop, ramping down if running, and latch; with hold only enable() ends it."""
        self._held |= hold
        self._latch(reason)
        if self.phase is Phase.RUNNING:
            self._begin_ramp()

    def cut(self, reason: str, now: float) -> None:
        """Latch, for a module that is not to be trusted with a ramp; the caller coasts it at once."""
        self._latch(reason)
        self._coast(now)

    def command_age(self, now: float) -> float:
        """Seconds since the last good command; infinite if there was none."""
        return math.inf if self._command_time is None else now - self._command_time

    def step(self, now: float, obstacles: tuple[str, ...] = ()) -> Action:
        """The action of this cycle; obstacles are reasons to stop that last (no resuming while there is one)."""
        if obstacles:
            self.stop("; ".join(obstacles))
        dt = 0.0 if self._last_step is None else min(now - self._last_step, LONGEST_STEP_S)
        self._last_step = now
        fresh = self.command_age(now) <= self._settings.stale_s
        if not obstacles:
            self._rearm(fresh, now)
        if self.phase is Phase.COASTING:
            return self._wait(now)
        if self.phase is Phase.RUNNING and not fresh:
            self._latch(f"no command for {self._settings.stale_s} s")
            self._begin_ramp()
        if self.phase is Phase.STOPPING:
            return self._ramp_down(now, dt)
        return self._follow(dt) if fresh and not self.latched else Action(ask=True)

    def _latch(self, reason: str) -> None:
        self.latched = True
        self.reason = reason
        self._rest_since = None

    def _rearm(self, fresh: bool, now: float) -> None:
        resume, since = self._settings.resume, self._rest_since
        rested = since is not None and now - since >= self._settings.rearm_s
        if (
            self.latched
            and fresh
            and not self._held
            and (resume == "auto" or (resume == "zero" and rested))
        ):
            self.enable()

    def _follow(self, dt: float) -> Action:
        self.phase = Phase.RUNNING
        most = self._settings.max_acceleration * dt
        change = self._command - self._velocity
        self._velocity += min(max(change, -most), most)
        return Action(velocity=self._velocity, ask=True)

    def _begin_ramp(self) -> None:
        self.phase = Phase.STOPPING
        shortest = abs(self._velocity) / self._settings.max_acceleration
        self._ramp = abs(self._velocity) / max(self._settings.ramp_s, shortest, 1e-3)

    def _ramp_down(self, now: float, dt: float) -> Action:
        left = abs(self._velocity) - self._ramp * dt
        if left <= AT_REST:
            return self._coast(now)
        self._velocity = math.copysign(left, self._velocity)
        return Action(velocity=self._velocity)

    def _coast(self, now: float) -> Action:
        self._velocity = 0.0
        self.phase = Phase.COASTING
        self._quiet_until = now + self._settings.module_timeout_s + QUIET_MARGIN_S
        return Action(coast=True)

    def _wait(self, now: float) -> Action:
        if now < self._quiet_until:
            return Action()
        self.phase = Phase.RESTING
        return Action(ask=True)
