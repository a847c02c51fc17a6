"""A linkage with another ratio than assumed."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "linkage ratio; strength is an assumption"


class RudderGain(Effect):
    """The rudder turns `factor` times as far as commanded: target = factor command. Neutral: 1."""

    name = "rudder_gain"
    kind = "actuator"
    equation = "target = factor command"
    source = SOURCE
    parameters = {"factor": Parameter(1.0, "1", 0.0, 3.0, SOURCE, typical=0.8)}
    strength = ("factor",)

    @staticmethod
    def rudder(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        return p.factor * command, {}
