# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""More drag close to a wall."""

from typing import Any

from fish_sim import pool
from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "assumption: confinement raises drag, decaying with distance (cf. Happel and Brenner 1983)"


class WallEffect(Effect):
    """Drag of every body grows by the factor 1 + k exp(-d / length).

        (X, Y, N) = -k exp(-d / length) (c_u u, c_v v, c_r r)

    d [m]: distance from the body's centre of mass to the nearest wall, 0 beyond; c: its Rayleigh drag.
    """

    name = "wall_effect"
    kind = "physics"
    equation = "drag of every body x (1 + k exp(-d/length)), d = distance to the nearest wall"
    source = SOURCE
    parameters = {
        "k": Parameter(0.0, "1", 0.0, 50.0, SOURCE, typical=2.5),
        "length": Parameter(0.2, "m", 0.02, 2.0, SOURCE),
    }
    strength = ("k",)
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench:
        gap = xp.fmin(pool.LENGTH / 2 - xp.fabs(body.x), pool.WIDTH / 2 - xp.fabs(body.y))
        grown = p.k * xp.exp(-xp.fmax(gap, 0.0) / p.length)
        return (
            -grown * body.drag_surge * body.u,
            -grown * body.drag_sway * body.v,
            -grown * body.drag_yaw * body.w,
        )
