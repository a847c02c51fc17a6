# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the servo bends the tail."""

from fish_sim.effects.effect import Effect, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "the project's model description: root of the tail (nominal) or fin at the tip"


class RudderPlacement(Effect):
    """A share of alpha turns the fin at the tip, the rest the root of the tail.

        rest of joint 1 = -(1 - tip_share) alpha,   direction of the fin = theta_n - tip_share alpha

    The reaction to alpha'' is neglected (light servo).
    """

    name = "rudder_placement"
    kind = "actuator"
    equation = (
        "joint 1 rests at -(1 - tip_share) alpha, the fin points along theta_n - tip_share alpha"
    )
    source = SOURCE
    parameters = {"tip_share": Parameter(0.0, "1", 0.0, 1.0, SOURCE, typical=0.6)}
    strength = ("tip_share",)

    @staticmethod
    def tip_share(p: Values) -> Scalar:
        return p.tip_share
