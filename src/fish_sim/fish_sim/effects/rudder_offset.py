# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A servo horn that is mounted at an angle."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "mounting error, one spline tooth is 0.25 rad; strength is an assumption"


class RudderOffset(Effect):
    """The rudder stands at a constant angle from the servo: alpha = servo + offset (positive steers left)."""

    name = "rudder_offset"
    kind = "actuator"
    equation = "alpha = servo + offset"
    source = SOURCE
    parameters = {"offset": Parameter(0.0, "rad", -0.8, 0.8, SOURCE, typical=0.06)}
    strength = ("offset",)

    has_linkage = True

    @staticmethod
    def linkage(p: Values, m: Values, servo: Scalar, dt: float, xp: Any) -> Followed:
        return servo + p.offset, {}
