# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A line to a fixed point."""

from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "massless elastic line; strengths are an assumption"
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
    source = SOURCE
    parameters = {
        "stiffness": Parameter(0.0, "N/m", 0.0, 100.0, SOURCE, typical=0.2),
        "length": Parameter(0.5, "m", 0.0, 5.0, SOURCE),
        "x": Parameter(0.0, "m", -5.0, 5.0, SOURCE, tries=(-1.2, 0.0, 1.2)),
        "y": Parameter(0.0, "m", -5.0, 5.0, SOURCE, tries=(-0.6, 0.0, 0.6)),
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
