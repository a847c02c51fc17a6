"""A servo horn that sits askew."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "mounting error, one spline tooth is 0.25 rad; strength is an assumption"


class RudderOffset(Effect):
    """A constant angle is added to every command: target = command + offset (positive steers left)."""

    name = "rudder_offset"
    kind = "actuator"
    equation = "target = command + offset"
    source = SOURCE
    parameters = {"offset": Parameter(0.0, "rad", -0.8, 0.8, SOURCE, typical=0.06)}
    strength = ("offset",)

    @staticmethod
    def rudder(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        return command + p.offset, {}
