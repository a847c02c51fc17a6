# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An open-loop swim, from the estimate's arrival to rest: when it begins, and what ends it. No ROS, no clock.

A fish that does not look where it swims is stopped before a wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fish_control.controller import Command
from fish_control.excitation import LIMITS, Excitation
from fish_control.line_of_sight import Motion
from fish_control.node_configs import ExciterConfig
from fish_control.pool import stopping_side, wall_distance
from fish_control.watchdog import EstimateHealth, estimate_fault


def heads_for_a_wall(motion: Motion, horizon: float, margin: float) -> bool:
    """Whether `horizon` [s] on, at its present velocity, the fish is nearer to a wall than `margin` [m] and than it is now."""
    cos, sin = math.cos(motion.heading), math.sin(motion.heading)
    vx, vy = motion.surge * cos - motion.sway * sin, motion.surge * sin + motion.sway * cos
    ahead = wall_distance(np.array([[motion.x + horizon * vx, motion.y + horizon * vy]]))
    return ahead < margin and ahead < wall_distance(np.array([[motion.x, motion.y]]))


def stopping_rudder(motion: Motion, rudder_range: float) -> float:
    """Rudder [rad] hard over to the side on which the fish comes to rest farther from the walls."""
    return stopping_side(motion.x, motion.y, motion.heading) * rudder_range


AT_REST = Command(0.0, 0.0, 0.0)
State = Literal["waiting", "resting", "swimming", "ended", "before a wall", "lost", "disarmed"]


@dataclass(frozen=True)
class Sight:
    """The newest estimate and what speaks for it."""

    motion: Motion
    signs: EstimateHealth


class Exciter:
    """Runs an excitation once; the guard looks at the estimate only to stop it, for good."""

    def __init__(self, config: ExciterConfig, excitation: Excitation) -> None:
        self._config = config
        self._excitation = excitation
        self._began = math.nan
        self.state: State = "waiting"
        self.reason = "waiting for odometry"

    def command(self, now: float, dt: float, sight: Sight | None, disarmed: str = "") -> Command:
        """The command of `now` [s], `dt` [s] after the one before; `state` and `reason` say what it is about.

        It begins when the robot is armed. After the end or a stop the excitation brings rotor and rudder to rest.

        Args:
            now: s.
            dt: s.
            sight: the newest estimate.
            disarmed: why the robot is disarmed; empty while it is armed, or where nobody arms it.
        """
        if disarmed:
            self._disarmed(disarmed)
        if (
            self.state == "waiting"
            and not disarmed
            and (sight is not None or not self._config.guard)
        ):
            self._began = now
            self._become("resting", "at rest")
        if self.state == "resting" and now - self._began >= self._config.rest:
            self._become("swimming", "swimming")
        if self.state in ("waiting", "resting"):
            return AT_REST
        if self.state == "swimming":
            self._look(sight)
        return self._excitation.command(dt)

    def _disarmed(self, reason: str) -> None:
        """Before the first stroke it is waited for; later nothing goes on by itself."""
        if self.state in ("waiting", "resting"):
            self._become("waiting", f"waiting for the robot to be armed: {reason}")
        elif self.state == "swimming":
            self._excitation.stop()
            self._become(
                "disarmed", f"stopped at {self._excitation.time:.1f} s: disarmed: {reason}"
            )

    def _look(self, sight: Sight | None) -> None:
        """End where the program does; stop where the guard finds a reason."""
        config, excitation, at = self._config, self._excitation, f"{self._excitation.time:.1f} s"
        if excitation.over:
            self._become("ended", f"ended at {at}, as programmed")
        elif config.guard and sight is not None:
            motion = sight.motion
            fault = estimate_fault(sight.signs, config.odometry_timeout, config.largest_variance)
            if fault is not None:
                excitation.stop()
                self._become("lost", f"stopped at {at}: {fault}")
            elif heads_for_a_wall(motion, config.horizon, config.margin):
                excitation.stop(stopping_rudder(motion, LIMITS.rudder_range))
                self._become(
                    "before a wall",
                    f"stopped at {at} before a wall, at ({motion.x:.2f}, {motion.y:.2f}) m",
                )

    def _become(self, state: State, reason: str) -> None:
        self.state, self.reason = state, reason
