# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Form drag on the head."""

from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "Fossen 2021, nonlinear damping: separate quadratic terms per direction; strengths are an assumption"


class QuadraticDrag(Effect):
    """Pressure drag of the hull grows with the square of its speed through the water.

        X = -k_u |u| u,   Y = -k_v |v| v,   N = -k_r |r| r

    Frame: base_link; u, v [m/s] relative to the water, r [rad/s].
    """

    name = "quadratic_drag"
    kind = "physics"
    equation = "X = -surge |u| u, Y = -sway |v| v, N = -yaw |r| r on the head"
    source = SOURCE
    parameters = {
        "surge": Parameter(0.0, "N s^2/m^2", 0.0, 20.0, SOURCE, typical=0.6),
        "sway": Parameter(0.0, "N s^2/m^2", 0.0, 100.0, SOURCE, typical=4.0),
        "yaw": Parameter(0.0, "N m s^2", 0.0, 0.1, SOURCE, typical=1.2e-3),
    }
    strength = ("surge", "sway", "yaw")
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        return (
            -p.surge * xp.fabs(body.u) * body.u,
            -p.sway * xp.fabs(body.v) * body.v,
            -p.yaw * xp.fabs(body.w) * body.w,
        )
