# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Play in the rudder's linkage."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "play operator (Visintin 1994); strength is an assumption"


class RudderBacklash(Effect):
    """The rudder is dragged along by the servo with free play of half-width `play` either side.

        alpha <- max(servo - play, min(servo + play, alpha))

    It starts at 0 (centred). Without play, where searches stand, all three are one, and the derivative is that of a rudder
    that is dragged along.
    """

    name = "rudder_backlash"
    kind = "actuator"
    equation = "alpha = clip(alpha, servo - play, servo + play)"
    source = SOURCE
    parameters = {"play": Parameter(0.0, "rad", 0.0, 0.8, SOURCE, typical=0.06)}
    strength = ("play",)
    has_linkage = True
    memory = ("dragged",)

    @staticmethod
    def linkage(p: Values, m: Values, servo: Scalar, dt: float, xp: Any) -> Followed:
        ahead, behind = servo - p.play, servo + p.play
        dragged = xp.where(
            m.dragged < ahead, ahead, xp.where(m.dragged > behind, behind, m.dragged)
        )
        return dragged, {"dragged": dragged}
