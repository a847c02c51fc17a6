# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A linkage with another ratio than assumed."""

from typing import Any

from fish_sim.effects.effect import Effect, Followed, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "linkage ratio; strength is an assumption"


class RudderGain(Effect):
    """The rudder turns `factor` times as far as the servo: alpha = factor servo. Neutral: 1."""

    name = "rudder_gain"
    kind = "actuator"
    equation = "alpha = factor servo"
    source = SOURCE
    parameters = {"factor": Parameter(1.0, "1", 0.0, 3.0, SOURCE, typical=0.8)}
    strength = ("factor",)

    has_linkage = True

    @staticmethod
    def linkage(p: Values, m: Values, servo: Scalar, dt: float, xp: Any) -> Followed:
        return p.factor * servo, {}
