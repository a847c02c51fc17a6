# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A servo that does not reach its full range."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "end stop or pulse width limit; strength is an assumption"
NO_LIMIT = 1.6  # rad, beyond every admissible rudder range
# rad, tried: a limit above all commands does nothing, so nothing leads from there to one below
LIMITS = (0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5)


class RudderSaturation(Effect):
    """The rudder stops at +-limit inside its nominal range: target = clip(command, -limit, limit).

    At and above the robot's rudder_range the limit does nothing.
    """

    name = "rudder_saturation"
    kind = "actuator"
    equation = "target = clip(command, -limit, limit)"
    source = SOURCE
    parameters = {
        "limit": Parameter(NO_LIMIT, "rad", 0.0, NO_LIMIT, SOURCE, typical=0.25, tries=LIMITS)
    }
    strength = ("limit",)

    @staticmethod
    def rudder(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        return xp.fmax(-p.limit, xp.fmin(command, p.limit)), {}
