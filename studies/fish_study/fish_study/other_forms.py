# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Physics that the vocabulary names, in a form other than the tool's own candidate; the right answer is that name."""

from __future__ import annotations

from typing import Any

from fish_sim.effects.effect import Effect, Flow, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "Taylor vortex (Saffman 1992, Vortex Dynamics, ch. 13); strengths are an assumption"


class Vortex(Effect):
    """One vortex somewhere in the pool: V_t = speed (r / core) exp((1 - r^2 / core^2) / 2) about (at_x, at_y).

    r [m]: distance from its middle, where the water rests; `speed` is reached at r = core. Frame: pool.
    """

    name = "vortex"
    kind = "physics"
    equation = "V_t = speed (r/core) exp((1 - r^2/core^2)/2) about (at_x, at_y)"
    source = SOURCE
    parameters = {
        "speed": Parameter(0.0, "m/s", -0.5, 0.5, SOURCE, typical=0.04),
        "at_x": Parameter(0.3, "m", -2.0, 2.0, SOURCE),
        "at_y": Parameter(0.2, "m", -1.0, 1.0, SOURCE),
        "core": Parameter(0.5, "m", 0.05, 2.0, SOURCE),
    }
    strength = ("speed",)

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        dx, dy, k = x - p.at_x, y - p.at_y, 1.0 / p.core**2
        turn = p.speed / p.core * xp.exp(0.5 * (1.0 - k * (dx**2 + dy**2)))
        gradient = (
            (turn * k * dx * dy, turn * (k * dy**2 - 1.0)),
            (turn * (1.0 - k * dx**2), -turn * k * dx * dy),
        )
        return (-turn * dy, turn * dx), gradient


OTHER_FORMS: dict[str, type[Effect]] = {"vortex": Vortex}
MEANS = {"vortex": "nonuniform_current"}
