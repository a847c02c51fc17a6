# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rotor and rudder by hand: what the operator wants, for as long as the deadman is held."""

from __future__ import annotations

import math

from fish_control import scalar_math
from fish_control.control_law import ActuatorState, ControlLimits, Setpoint, actuator_step
from fish_control.controller import Command

# presses of a key from rest to full throttle, and from centre to the largest rudder angle
STEPS = 10


class ManualDrive:
    """The operator's set-points; without a word for `timeout` [s] the rotor stops and the rudder goes to the centre.

    Attributes:
        throttle: 0 to 1. rudder: -1 to 1 of the largest angle, positive steers left.
    """

    def __init__(self, timeout: float, limits: ControlLimits | None = None) -> None:
        if not 0.05 <= timeout <= 5.0:
            raise ValueError(f"timeout is {timeout!r} s, expected 0.05 to 5 s")
        self._timeout, self._limits = timeout, limits or ControlLimits()
        self.throttle = self.rudder = 0.0
        self._heard = -math.inf
        self._actuators = ActuatorState()

    def hold(self, now: float) -> None:
        """The deadman is held at `now` [s]."""
        self._heard = now

    def release(self) -> None:
        """The deadman is let go: rest at once."""
        self._heard = -math.inf
        self.throttle = self.rudder = 0.0

    def held(self, now: float) -> bool:
        """Whether the operator was heard within the time-out."""
        return 0.0 <= now - self._heard <= self._timeout

    def wish(self, throttle: float, rudder: float) -> None:
        """Set-points, as shares of the largest; numbers beyond are cut off, what is no number is rest."""
        self.throttle = min(max(throttle, 0.0), 1.0) if math.isfinite(throttle) else 0.0
        self.rudder = min(max(rudder, -1.0), 1.0) if math.isfinite(rudder) else 0.0

    def press(self, key: str) -> bool:
        """A key: up, down, left, right change a set-point by a step, anything else is rest; whether it is an arrow."""
        throttle, rudder = {
            "up": (1, 0),
            "down": (-1, 0),
            "left": (0, 1),
            "right": (0, -1),
        }.get(key, (0, 0))
        if throttle == rudder == 0:
            self.release()
            return False
        self.wish(self.throttle + throttle / STEPS, self.rudder + rudder / STEPS)
        return True

    def command(self, now: float, dt: float) -> Command:
        """Advance the actuators by dt [s]."""
        if not self.held(now):
            self.release()
        wanted = Setpoint(self.rudder * self._limits.rudder_range, self.throttle)
        self._actuators, speed = actuator_step(
            self._actuators, wanted, dt, self._limits, scalar_math
        )
        phase = math.fmod(self._actuators.phase, 2.0 * math.pi)
        return Command(phase, float(speed), float(self._actuators.alpha))
