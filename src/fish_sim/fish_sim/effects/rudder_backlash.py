"""Play in the rudder's linkage."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "play operator (Visintin 1994); strength is an assumption"


class RudderBacklash(Effect):
    """The rudder is dragged along by a command with free play of half-width `play` either side.

        target <- max(command - play, min(command + play, target))

    The target starts at 0 (centred).
    """

    name = "rudder_backlash"
    kind = "actuator"
    equation = "target = clip(target, command - play, command + play)"
    source = SOURCE
    parameters = {"play": Parameter(0.0, "rad", 0.0, 0.8, SOURCE, typical=0.06)}
    strength = ("play",)
    memory = ("target",)

    @staticmethod
    def rudder(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        target = xp.fmax(command - p.play, xp.fmin(command + p.play, m.target))
        return target, {"target": target}
