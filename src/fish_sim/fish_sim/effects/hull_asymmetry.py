# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A hull that is not quite symmetric."""

from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "Y_uu, N_uu of an asymmetric hull (Fossen 2021); strengths are an assumption"


class HullAsymmetry(Effect):
    """A crooked hull is pushed to one side and turned by its own way through the water.

        Y = sway u |u|,   N = yaw u |u|

    Frame: base_link, left and counter-clockwise positive; u [m/s] relative to the water.
    """

    name = "hull_asymmetry"
    kind = "physics"
    equation = "Y = sway u|u|, N = yaw u|u| on the head"
    source = SOURCE
    parameters = {
        "sway": Parameter(0.0, "N s^2/m^2", -5.0, 5.0, SOURCE, typical=0.15),
        "yaw": Parameter(0.0, "N s^2/m", -0.5, 0.5, SOURCE, typical=0.02),
    }
    strength = ("sway", "yaw")

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        pressure = body.u * xp.fabs(body.u)
        return 0.0, p.sway * pressure, p.yaw * pressure
