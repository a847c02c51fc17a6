"""Steady flow that differs from place to place."""

import math
from itertools import product
from typing import Any

from fish_sim import pool
from fish_sim.effects.effect import Effect, Flow, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "linear expansion and first stream-function modes of a basin; strengths are an assumption"
MODES = tuple(product((1, 2, 3), (1, 2)))  # half waves along and across the pool


def _gyre(strength: float) -> Parameter:
    return Parameter(0.0, "m/s", -0.5, 0.5, SOURCE, typical=strength)


class NonuniformCurrent(Effect):
    """Incompressible flow: the linear expansion about the pool's centre plus six gyres that close at the walls.

        V_x = mean_x +  strain x + shear_x y + sum_mn gyre_mn sin(m pi a) cos(n pi b)
        V_y = mean_y + shear_y x -  strain y - sum_mn gyre_mn (m W / n L) cos(m pi a) sin(n pi b)
        a = x / L + 1/2,   b = y / W + 1/2,   m = 1, 2, 3,   n = 1, 2

    L, W: length and width of the pool. Every part is divergence-free; gyre_mn is the highest speed along the pool of a pattern of
    m by n eddies (stream function (W / n pi) gyre_mn sin(m pi a) sin(n pi b)); gyre_11 > 0 turns counter-clockwise.
    A solid rotation is shear_y = -shear_x. The mean alone is no strength: that is the effect `current`. Frame: pool.
    """

    name = "nonuniform_current"
    kind = "physics"
    equation = (
        "V_x = mean_x + strain x + shear_x y + sum gyre_mn sin(m pi a) cos(n pi b), "
        "V_y = mean_y + shear_y x - strain y - sum gyre_mn (m W/n L) cos(m pi a) sin(n pi b), "
        "a = x/L + 1/2, b = y/W + 1/2"
    )
    source = SOURCE
    parameters = {
        "mean_x": Parameter(0.0, "m/s", -0.5, 0.5, SOURCE),
        "mean_y": Parameter(0.0, "m/s", -0.5, 0.5, SOURCE),
        "strain": Parameter(0.0, "1/s", -0.5, 0.5, SOURCE, typical=0.005),
        "shear_x": Parameter(0.0, "1/s", -0.5, 0.5, SOURCE, typical=0.03),
        "shear_y": Parameter(0.0, "1/s", -0.5, 0.5, SOURCE, typical=-0.01),
        **{f"gyre_{m}{n}": _gyre(0.03 if m == n == 1 else 0.01) for m, n in MODES},
    }
    strength = ("strain", "shear_x", "shear_y", *(f"gyre_{m}{n}" for m, n in MODES))

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        L, W = pool.LENGTH, pool.WIDTH
        # V_x, V_y, dV_x/dx, dV_x/dy, dV_y/dx, dV_y/dy
        total = (
            p.mean_x + p.strain * x + p.shear_x * y, p.mean_y + p.shear_y * x - p.strain * y,
            p.strain, p.shear_x, p.shear_y, -p.strain,
        )  # fmt: skip
        for m, n in MODES:
            gyre, kx, ky = getattr(p, f"gyre_{m}{n}"), m * math.pi / L, n * math.pi / W
            sx, cx = xp.sin(kx * (x + L / 2)), xp.cos(kx * (x + L / 2))
            sy, cy = xp.sin(ky * (y + W / 2)), xp.cos(ky * (y + W / 2))
            mode = (
                sx * cy, -kx / ky * cx * sy,
                kx * cx * cy, -ky * sx * sy, kx**2 / ky * sx * sy, -kx * cx * cy,
            )  # fmt: skip
            total = tuple(t + gyre * part for t, part in zip(total, mode, strict=True))
        return total[:2], (total[2:4], total[4:])
