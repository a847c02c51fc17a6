# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tail's tip slides sideways."""

from collections.abc import Mapping
from typing import Any

from fish_sim.effects.effect import Effect, Grip, Values
from fish_sim.parameter import Parameter

SOURCE = "lateral drag of a finite fin instead of the no-slip constraint; strength is an assumption"


class TipSlip(Effect):
    """The water holds the tip with a finite lateral grip.

        force = -grip slip,   grip = 1 / mobility

    slip [m/s]: velocity of the tip through the water, normal to the fin. Mobility 0 is no slip.
    """

    name = "tip_slip"
    kind = "physics"
    equation = "lateral force on the tip = -slip / mobility (nominal: no slip)"
    source = SOURCE
    parameters = {"mobility": Parameter(0.0, "m/(N s)", 0.0, 10.0, SOURCE, typical=1.0 / 6.0)}
    strength = ("mobility",)

    @staticmethod
    def grip(p: Values, z: Values, xp: Any) -> Grip:
        return Grip(p.mobility)

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        return {"grip": (1.0 / p.mobility if p.mobility > 0 else float("inf"), "N s/m")}
