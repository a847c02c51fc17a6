# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drag that does not depend on speed."""

from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.parameter import Parameter

SOURCE = "Coulomb friction, regularised; strengths are an assumption (surface film, cable)"
SMOOTHING = 0.005  # m/s, the force turns over within this speed
TURN_SMOOTHING = 0.05  # rad/s, the moment: the same speed 0.1 m away


class DryFriction(Effect):
    """A force of constant size against the head's way through the water, and a moment of constant size against its turning.

        F = -force tanh(|V| / v_0) V / |V|,   N = -moment tanh(w / w_0)
        V = (u, v),   v_0 = 5 mm/s,   w_0 = 0.05 rad/s

    Frame: base_link; V [m/s] relative to the water, w [rad/s] rate of turn.
    """

    name = "dry_friction"
    kind = "physics"
    equation = "F = -force V/|V| (smooth below 5 mm/s), N = -moment sign(w) (smooth below 0.05 rad/s) on the head"
    source = SOURCE
    parameters = {
        "force": Parameter(0.0, "N", 0.0, 1.0, SOURCE, typical=0.02),
        "moment": Parameter(0.0, "N m", 0.0, 0.05, SOURCE, typical=0.001),
    }
    strength = ("force", "moment")
    dissipative = True

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        speed = xp.sqrt(body.u**2 + body.v**2 + (1e-3 * SMOOTHING) ** 2)  # never 0/0
        scale = -p.force * xp.tanh(speed / SMOOTHING) / speed
        return scale * body.u, scale * body.v, -p.moment * xp.tanh(body.w / TURN_SMOOTHING)
