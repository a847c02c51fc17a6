# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A motor with a top speed."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "no-load speed at the given voltage; strength is an assumption"
NO_LIMIT = 1000.0  # rad/s, far above every commanded speed (nominal maximum 151 rad/s)
# rad/s, tried: a limit above all commands does nothing, so nothing leads from there to one below
LIMITS = (20.0, 25.0, 32.0, 40.0, 50.0, 63.0, 79.0, 99.0, 124.0)


class RotorSaturation(Effect):
    """The rotor does not exceed a speed: speed = clip(command, -limit, limit)."""

    name = "rotor_saturation"
    kind = "actuator"
    equation = "speed = clip(command, -limit, limit)"
    source = SOURCE
    parameters = {
        "limit": Parameter(NO_LIMIT, "rad/s", 0.0, NO_LIMIT, SOURCE, typical=70.0, tries=LIMITS)
    }
    strength = ("limit",)

    @staticmethod
    def rotor(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        return xp.fmax(-p.limit, xp.fmin(command, p.limit)), {}
