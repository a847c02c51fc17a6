# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Losses in the tail's material."""

from typing import Any

from fish_sim.effects.effect import Effect, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "Kelvin-Voigt material; strength is an assumption"


class TailJointDamping(Effect):
    """Moment against the rate of every joint: torque = c phi'.

    phi' [rad/s]: rate of the joint's deflection from its rest.
    """

    name = "tail_joint_damping"
    kind = "physics"
    equation = "torque = c phi' at every tail joint"
    source = SOURCE
    parameters = {"c": Parameter(0.0, "N m s/rad", 0.0, 0.03, SOURCE, typical=1e-3)}
    strength = ("c",)
    dissipative = True

    @staticmethod
    def joint_torque(p: Values, joint: int, angle: Scalar, rate: Scalar, xp: Any) -> Scalar:
        return p.c * rate
