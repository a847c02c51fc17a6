# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Steady flow that differs from place to place."""

import math
from itertools import product
from typing import Any

from fish_sim import pool
from fish_sim.effects.effect import Effect, Flow, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "linear expansion and first stream-function modes of a basin; strengths are an assumption"
# half waves along and across the pool and its margin, down to 0.57 m: what resolves an eddy of 0.3 m radius
LONG, WIDE = tuple(range(1, 9)), tuple(range(1, 5))
MARGIN = 0.15  # m beyond the walls where the gyres close: a flow seen on the fish's tracks need not close at the walls
LENGTH, WIDTH = pool.LENGTH + 2.0 * MARGIN, pool.WIDTH + 2.0 * MARGIN
MODES = tuple(product(LONG, WIDE))


def _gyre(m: int, n: int) -> Parameter:
    """The first swirls the most; eddies of less than a metre by 0.7 m are weaker."""
    typical = 0.03 if m == n == 1 else 0.01 if m <= 4 and n <= 3 else 0.004
    return Parameter(0.0, "m/s", -0.5, 0.5, SOURCE, typical=typical)


class NonuniformCurrent(Effect):
    """Incompressible flow: the linear expansion about the pool's centre plus gyres that close a little beyond the walls.

        V_x = mean_x +  strain x + shear_x y + sum_mn gyre_mn sin(m pi a) cos(n pi b)
        V_y = mean_y + shear_y x -  strain y - sum_mn gyre_mn (m W / n L) cos(m pi a) sin(n pi b)
        a = x / L + 1/2,   b = y / W + 1/2,   m = 1 .. 8,   n = 1 .. 4

    L, W: length and width of the pool with a margin of 0.15 m all round: with it an eddy of 0.74 m, which closes at no wall, is
    resolved to 4 to 11 % instead of 10 to 22, one of 0.36 m to 10 to 18 instead of 7 to 13. Every part is divergence-free;
    gyre_mn is the highest speed along the pool of a pattern of m by n eddies (stream function
    (W / n pi) gyre_mn sin(m pi a) sin(n pi b)); gyre_11 > 0 turns counter-clockwise.
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
        **{f"gyre_{m}{n}": _gyre(m, n) for m, n in MODES},
    }
    strength = ("strain", "shear_x", "shear_y", *(f"gyre_{m}{n}" for m, n in MODES))

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        kx, ky = math.pi / LENGTH, math.pi / WIDTH
        along = harmonics(xp.sin(kx * x + math.pi / 2), xp.cos(kx * x + math.pi / 2), len(LONG))
        across = harmonics(xp.sin(ky * y + math.pi / 2), xp.cos(ky * y + math.pi / 2), len(WIDE))
        # V_x, V_y, dV_x/dx, dV_x/dy, dV_y/dx, dV_y/dy
        total = (
            p.mean_x + p.strain * x + p.shear_x * y,
            p.mean_y + p.shear_y * x - p.strain * y,
            p.strain,
            p.shear_x,
            p.shear_y,
            -p.strain,
        )
        for n, (sy, cy) in enumerate(across, 1):
            gyres = [(m * kx, getattr(p, f"gyre_{m}{n}"), *along[m - 1]) for m in LONG]
            f, q = sum(g * sx for _, g, sx, _ in gyres), n * ky
            df, ddf = (
                sum(k * g * cx for k, g, _, cx in gyres),
                sum(-(k**2) * g * sx for k, g, sx, _ in gyres),
            )
            modes = (f * cy, -df * sy / q, df * cy, -q * f * sy, -ddf * sy / q, -df * cy)
            total = tuple(t + part for t, part in zip(total, modes, strict=True))
        return total[:2], (total[2:4], total[4:])


def harmonics(sine: Scalar, cosine: Scalar, count: int) -> list[tuple[Scalar, Scalar]]:
    """(sin k a, cos k a) for k = 1 .. count from those of a: additions are cheaper than sines."""
    found = [(sine, cosine)]
    for _ in range(count - 1):
        s, c = found[-1]
        found.append((s * cosine + c * sine, c * cosine - s * sine))
    return found
