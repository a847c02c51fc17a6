# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A servo that approaches its target gradually."""

from typing import Any

from fish_sim.effects.effect import Effect, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "first-order servo; strength is an assumption (hobby servos: 0.02 to 0.15 s)"
SHORTEST = 1e-6  # s, keeps exp(-dt/T) defined at T = 0


class RudderLag(Effect):
    """The servo approaches its target with a time constant, at most at its rate limit.

    alpha' = (target - alpha) / T,   exactly over a period dt: alpha += (1 - exp(-dt / T)) (target - alpha)
    """

    name = "rudder_lag"
    kind = "actuator"
    equation = "alpha' = (command - alpha)/time_constant, at most the servo's rate limit"
    source = SOURCE
    parameters = {"time_constant": Parameter(0.0, "s", 0.0, 2.0, SOURCE, typical=0.12)}
    strength = ("time_constant",)

    @staticmethod
    def servo(p: Values, alpha: Scalar, target: Scalar, dt: float, xp: Any) -> Scalar:
        return alpha + (1.0 - xp.exp(-dt / xp.fmax(p.time_constant, SHORTEST))) * (target - alpha)
