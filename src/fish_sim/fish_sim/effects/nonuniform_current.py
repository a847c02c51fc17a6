"""Steady flow that differs from place to place."""

import math
from typing import Any

from fish_sim import pool
from fish_sim.effects.effect import Effect, Flow, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = (
    "first-order expansion of an incompressible flow plus the basin's first gyre; strengths are an assumption"
)


class NonuniformCurrent(Effect):
    """Linear incompressible flow about the pool's centre plus one gyre that closes at the walls.

        V_x =  strain x + shear_x y - gyre sin(pi y / W) cos(pi x / L)
        V_y = shear_y x - strain y  + gyre (W / L) sin(pi x / L) cos(pi y / W)

    L, W: length and width of the pool. Both parts are divergence-free; gyre > 0 turns counter-clockwise and
    is the speed reached at the middle of the long walls. A solid rotation is shear_y = -shear_x. Frame: pool.
    """

    name = "nonuniform_current"
    kind = "physics"
    equation = (
        "V_x = strain x + shear_x y - gyre sin(pi y/W) cos(pi x/L), "
        "V_y = shear_y x - strain y + gyre W/L sin(pi x/L) cos(pi y/W)"
    )
    source = SOURCE
    parameters = {
        "strain": Parameter(0.0, "1/s", -0.5, 0.5, SOURCE, typical=0.005),
        "shear_x": Parameter(0.0, "1/s", -0.5, 0.5, SOURCE, typical=0.03),
        "shear_y": Parameter(0.0, "1/s", -0.5, 0.5, SOURCE, typical=-0.01),
        "gyre": Parameter(0.0, "m/s", -0.5, 0.5, SOURCE, typical=0.03),
    }
    strength = ("strain", "shear_x", "shear_y", "gyre")

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        kx, ky = math.pi / pool.LENGTH, math.pi / pool.WIDTH
        sx, cx, sy, cy = xp.sin(kx * x), xp.cos(kx * x), xp.sin(ky * y), xp.cos(ky * y)
        across = p.gyre * (kx / ky)
        flow = (
            p.strain * x + p.shear_x * y - p.gyre * sy * cx,
            p.shear_y * x - p.strain * y + across * sx * cy,
        )
        gradient = (
            (p.strain + p.gyre * kx * sy * sx, p.shear_x - p.gyre * ky * cy * cx),
            (p.shear_y + across * kx * cx * cy, -p.strain - across * ky * sx * sy),
        )
        return flow, gradient
