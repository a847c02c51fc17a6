# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A rotor whose centre of mass is off its axis."""

import math
from collections.abc import Mapping
from typing import Any

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Values, Wrench
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "rigid-body dynamics of an eccentric rotor; strength is an assumption"


class RotorImbalance(Effect):
    """The centrifugal and tangential reaction of the eccentric rotor on the head.

        F = (r + phi')^2 R(phi) m - phi'' R(phi) m_perp,   m = (ahead, left),   m_perp = (-left, ahead)

    m [kg m]: mass times eccentricity at rotor angle 0, base_link axes; R(phi) turns by the rotor's angle phi,
    which is 0 at the start. The axis is at the head's centre of mass. Neglected: r' in the tangential term
    (|r'| is below 5 % of |phi''|) and the recoil's moment about the axis.
    """

    name = "rotor_imbalance"
    kind = "physics"
    equation = "F = (r + phi')^2 R(phi) m - phi'' R(phi) m_perp on the head, m = (ahead, left)"
    source = SOURCE
    parameters = {
        "ahead": Parameter(0.0, "kg m", -1e-2, 1e-2, SOURCE, typical=6e-5),
        "left": Parameter(0.0, "kg m", -1e-2, 1e-2, SOURCE, typical=3e-5),
    }
    strength = ("ahead", "left")
    states = ("angle",)

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        if body.name != "head":
            return None
        cos, sin = xp.cos(z.angle), xp.sin(z.angle)
        ahead, left = p.ahead * cos - p.left * sin, p.ahead * sin + p.left * cos
        spin = (body.w + drive.rotor_speed) ** 2
        push = drive.rotor_acceleration
        return spin * ahead + push * left, spin * left - push * ahead, 0.0

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return (drive.rotor_speed,)

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        return {
            "mass_eccentricity": (math.hypot(p.ahead, p.left), "kg m"),
            "phase": (math.atan2(p.left, p.ahead), "rad"),
        }
