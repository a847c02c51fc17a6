# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A tail that stiffens as it bends."""

from typing import Any

from fish_sim.effects.effect import Effect, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

SOURCE = "Duffing spring; strength is an assumption"


class TailHardening(Effect):
    """Cubic term of the stiffness at every joint: torque = k3 phi^3.

    phi [rad]: deflection of the joint from its rest (joint 1 rests at -alpha).
    """

    name = "tail_hardening"
    kind = "physics"
    equation = "torque = k3 phi^3 at every tail joint, in addition to tail_stiffness phi"
    source = SOURCE
    parameters = {"k3": Parameter(0.0, "N m/rad^3", 0.0, 3.0, SOURCE, typical=0.3)}
    strength = ("k3",)

    @staticmethod
    def joint_torque(p: Values, joint: int, angle: Scalar, rate: Scalar, xp: Any) -> Scalar:
        return p.k3 * angle**3
