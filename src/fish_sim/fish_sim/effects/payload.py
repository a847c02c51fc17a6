# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Something heavy tied to the head."""

from fish_sim.effects.effect import Effect, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "point mass; strength is an assumption"


class Payload(Effect):
    """A point mass on the head at (forward, left) of its centre of mass; without added mass or drag."""

    name = "payload"
    kind = "physics"
    equation = "point mass at (forward, left) on the head"
    source = SOURCE
    parameters = {
        "mass": Parameter(0.0, "kg", 0.0, 2.0, SOURCE, typical=0.06),
        "forward": Parameter(0.04, "m", -0.15, 0.15, SOURCE, tries=(-0.04, 0.04)),
        "left": Parameter(0.02, "m", -0.15, 0.15, SOURCE, tries=(-0.02, 0.02)),
    }
    strength = ("mass",)

    @staticmethod
    def point_masses(p: Values) -> tuple[tuple[Scalar, Scalar, Scalar], ...]:
        return ((p.mass, p.forward, p.left),)
