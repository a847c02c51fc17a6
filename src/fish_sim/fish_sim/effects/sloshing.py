# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's standing wave."""

import math
from collections.abc import Mapping
from typing import Any

from fish_sim import pool
from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "first longitudinal seiche mode (Lamb 1932); strength is an assumption"
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
    source = SOURCE
    parameters = {
        "sine": Parameter(0.0, "N", -1.0, 1.0, SOURCE, typical=0.02),
        "cosine": Parameter(0.0, "N", -1.0, 1.0, SOURCE, typical=0.01),
        "frequency": Parameter(0.4, "Hz", 0.05, 3.0, SOURCE, tries=FREQUENCIES),
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
