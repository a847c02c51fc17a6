# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Steady uniform flow through the pool."""

from typing import Any

from fish_sim.effects.effect import Effect, Flow, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "Fossen 2021, ocean currents: irrotational constant current; strength is an assumption"


class Current(Effect):
    """The water moves as a whole: V = (x, y), constant in time and place.

    Frame: pool [m/s]. Enters added mass, drag and tip constraint, which see velocities relative to the water.
    """

    name = "current"
    kind = "physics"
    equation = "V_water = (x, y) in the pool frame"
    source = SOURCE
    parameters = {
        "x": Parameter(0.0, "m/s", -0.5, 0.5, SOURCE, typical=0.03),
        "y": Parameter(0.0, "m/s", -0.5, 0.5, SOURCE, typical=-0.02),
    }
    strength = ("x", "y")

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        return (p.x, p.y), ((0.0, 0.0), (0.0, 0.0))
