# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What surrounds the fish: currents, walls, the pool's standing wave, a line to a fixed point, a push that has no name."""

import math
from collections.abc import Mapping
from itertools import product
from typing import Any

from fish_node import pool
from fish_sim.effects.effect import BodyMotion, Drive, Effect, Flow, Values, Wrench
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter


class Current(Effect):
    """The water moves as a whole: V = (x, y), constant in time and place.

    Frame: pool [m/s]. Enters added mass, drag and tip constraint, which see velocities relative to the water.
    """

    name = "current"
    kind = "physics"
    equation = "V_water = (x, y) in the pool frame"
    source = "Fossen 2021, ocean currents: irrotational constant current; strength is an assumption"
    parameters = {
        "x": Parameter(0.0, "m/s", -0.5, 0.5, source, typical=0.03),
        "y": Parameter(0.0, "m/s", -0.5, 0.5, source, typical=-0.02),
    }
    strength = ("x", "y")

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        return (p.x, p.y), ((0.0, 0.0), (0.0, 0.0))


FLOW_SOURCE = (
    "linear expansion and first stream-function modes of a basin; strengths are an assumption"
)
# half waves along and across the pool and its margin, down to 0.57 m: what resolves an eddy of 0.3 m radius
LONG, WIDE = tuple(range(1, 9)), tuple(range(1, 5))
MARGIN = 0.15  # m beyond the walls where the gyres close: a flow seen on the fish's tracks need not close at the walls
BASIN_LENGTH, BASIN_WIDTH = pool.LENGTH + 2.0 * MARGIN, pool.WIDTH + 2.0 * MARGIN
MODES = tuple(product(LONG, WIDE))


def _gyre(m: int, n: int) -> Parameter:
    """The first swirls the most; eddies of less than a metre by 0.7 m are weaker."""
    typical = 0.03 if m == n == 1 else 0.01 if m <= 4 and n <= 3 else 0.004
    return Parameter(0.0, "m/s", -0.5, 0.5, FLOW_SOURCE, typical=typical)


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
    source = FLOW_SOURCE
    parameters = {
        "mean_x": Parameter(0.0, "m/s", -0.5, 0.5, FLOW_SOURCE),
        "mean_y": Parameter(0.0, "m/s", -0.5, 0.5, FLOW_SOURCE),
        "strain": Parameter(0.0, "1/s", -0.5, 0.5, FLOW_SOURCE, typical=0.005),
        "shear_x": Parameter(0.0, "1/s", -0.5, 0.5, FLOW_SOURCE, typical=0.03),
        "shear_y": Parameter(0.0, "1/s", -0.5, 0.5, FLOW_SOURCE, typical=-0.01),
        **{f"gyre_{m}{n}": _gyre(m, n) for m, n in MODES},
    }
    strength = ("strain", "shear_x", "shear_y", *(f"gyre_{m}{n}" for m, n in MODES))

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow:
        kx, ky = math.pi / BASIN_LENGTH, math.pi / BASIN_WIDTH
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


class WallEffect(Effect):
    """Drag of every body grows by the factor 1 + k exp(-d / length).

        (X, Y, N) = -k exp(-d / length) (c_u u, c_v v, c_r r)

    d [m]: distance from the body's centre of mass to the nearest wall, 0 beyond; c: its Rayleigh drag.
    """

    name = "wall_effect"
    kind = "physics"
    equation = "drag of every body x (1 + k exp(-d/length)), d = distance to the nearest wall"
    source = (
        "assumption: confinement raises drag, decaying with distance (cf. Happel and Brenner 1983)"
    )
    parameters = {
        "k": Parameter(0.0, "1", 0.0, 50.0, source, typical=2.5),
        "length": Parameter(0.2, "m", 0.02, 2.0, source),
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


# a tenth apart: what ten seconds can tell from each other
FREQUENCIES = tuple(0.1 * k for k in range(1, 13))


class Sloshing(Effect):
    """The first standing wave along the pool pushes the head to and fro at its own frequency.

        F_x = (sine sin(phase) + cosine cos(phase)) cos(pi x / L),   phase' = 2 pi frequency

    F_x [N] along the pool's x, x [m] the place of the head, L the pool's length; the water moves most at the
    centre and not at the end walls. Free frequency of this mode: sqrt(g k tanh(k h)) / 2 pi with k = pi / L,
    0.25 Hz at h = 0.5 m depth, 0.43 Hz in deep water. Phase 0 is the start of the run.
    """

    name = "sloshing"
    kind = "physics"
    equation = (
        "F_x = (sine sin(2 pi f t) + cosine cos(2 pi f t)) cos(pi x/L) on the head, pool frame"
    )
    source = "first longitudinal seiche mode (Lamb 1932); strength is an assumption"
    parameters = {
        "sine": Parameter(0.0, "N", -1.0, 1.0, source, typical=0.02),
        "cosine": Parameter(0.0, "N", -1.0, 1.0, source, typical=0.01),
        "frequency": Parameter(0.4, "Hz", 0.05, 3.0, source, tries=FREQUENCIES),
    }
    strength = ("sine", "cosine")
    states = ("phase",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        push = p.sine * xp.sin(z.phase) + p.cosine * xp.cos(z.phase)
        push = push * xp.cos(math.pi / pool.LENGTH * body.x)
        return push * body.cos, -push * body.sin, 0.0

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return (2.0 * math.pi * p.frequency,)

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        return {
            "amplitude": (math.hypot(p.sine, p.cosine), "N"),
            "phase": (math.atan2(p.cosine, p.sine), "rad"),
        }


TRANSITION = 0.01  # m, from slack to taut within this much either side of the line's length


class Tether(Effect):
    """A line from the head's centre of mass to an anchor pulls when it is taut.

        F = stiffness s(d - length) towards the anchor
        s(e) = 0 for e < -w,   (e + w)^2 / 4w between,   e for e > w

    d [m]: distance to the anchor (x, y) in the pool frame; w = 10 mm makes the force smooth; slack is zero.
    """

    name = "tether"
    kind = "physics"
    equation = "F = stiffness max(d - length, 0) towards the anchor (x, y), on the head"
    source = "massless elastic line; strengths are an assumption"
    parameters = {
        "stiffness": Parameter(0.0, "N/m", 0.0, 100.0, source, typical=0.2),
        "length": Parameter(0.5, "m", 0.0, 5.0, source),
        "x": Parameter(0.0, "m", -5.0, 5.0, source, tries=(-1.2, 0.0, 1.2)),
        "y": Parameter(0.0, "m", -5.0, 5.0, source, tries=(-0.6, 0.0, 0.6)),
    }
    strength = ("stiffness",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        dx, dy = p.x - body.x, p.y - body.y
        distance = xp.sqrt(dx**2 + dy**2 + 1e-12)  # never 0/0
        excess = distance - p.length
        bent = xp.fmin(xp.fmax(excess, -TRANSITION), TRANSITION) + TRANSITION
        stretch = bent**2 / (4 * TRANSITION) + xp.fmax(excess - TRANSITION, 0.0)
        pull = p.stiffness * stretch / distance
        fx, fy = pull * dx, pull * dy
        return fx * body.cos + fy * body.sin, fy * body.cos - fx * body.sin, 0.0


class Disturbance(Effect):
    """A wrench on the head, in its own frame.

        (X, Y, N) = (surge, sway, yaw)

    Not part of the diagnosis vocabulary: filters drive it with noise to stand for the unexplained, simulations to
    stand for random water motion.
    """

    name = "disturbance"
    kind = "physics"
    equation = "(X, Y, N) = (surge, sway, yaw) on the head"
    source = "this project: latent force of grey-box models (Kristensen, Madsen and Jorgensen 2004)"
    parameters = {
        "surge": Parameter(0.0, "N", -math.inf, math.inf, source, typical=0.01),
        "sway": Parameter(0.0, "N", -math.inf, math.inf, source, typical=0.05),
        "yaw": Parameter(0.0, "N m", -math.inf, math.inf, source, typical=1e-3),
    }
    strength = ("surge", "sway", "yaw")

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        return (p.surge, p.sway, p.yaw) if body.name == "head" else None
