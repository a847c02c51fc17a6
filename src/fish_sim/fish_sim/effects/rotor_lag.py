# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A motor that follows its speed command late."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "first-order speed loop; strength is an assumption"
SHORTEST = 1e-6  # s, keeps exp(-dt/T) defined at T = 0


class RotorLag(Effect):
    """The rotor's speed follows the nominal course, linear between commands, with a time constant.

        speed' = (c(t) - speed) / T,   c(t) = c_0 + a t,   a = (c_1 - c_0) / dt

    Exactly over one period: speed_1 = c_1 - a T + (speed_0 - c_0 + a T) exp(-dt / T). Starts at rest.
    """

    name = "rotor_lag"
    kind = "actuator"
    equation = "speed' = (command - speed)/time_constant"
    source = SOURCE
    parameters = {"time_constant": Parameter(0.0, "s", 0.0, 2.0, SOURCE, typical=0.03)}
    strength = ("time_constant",)
    memory = ("speed", "command")

    @staticmethod
    def rotor(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        behind = p.time_constant * (command - m.command) / dt
        kept = xp.exp(-dt / xp.fmax(p.time_constant, SHORTEST))
        speed = command - behind + (m.speed - m.command + behind) * kept
        return speed, {"speed": speed, "command": command}
