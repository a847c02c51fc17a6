# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tail: stiffness and losses of its joints, and how its tip holds the water."""

from collections.abc import Mapping
from typing import Any

from fish_sim.effects.effect import Drive, Effect, Grip, Values
from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter


class TailHardening(Effect):
    """Cubic term of the stiffness at every joint: torque = k3 phi^3.

    phi [rad]: deflection of the joint from its rest (joint 1 rests at -alpha).
    """

    name = "tail_hardening"
    kind = "physics"
    equation = "torque = k3 phi^3 at every tail joint, in addition to tail_stiffness phi"
    source = "Duffing spring; strength is an assumption"
    parameters = {"k3": Parameter(0.0, "N m/rad^3", 0.0, 3.0, source, typical=0.3)}
    strength = ("k3",)

    @staticmethod
    def joint_torque(p: Values, joint: int, angle: Scalar, rate: Scalar, xp: Any) -> Scalar:
        return p.k3 * angle**3


class TailJointDamping(Effect):
    """Moment against the rate of every joint: torque = c phi'.

    phi' [rad/s]: rate of the joint's deflection from its rest.
    """

    name = "tail_joint_damping"
    kind = "physics"
    equation = "torque = c phi' at every tail joint"
    source = "Kelvin-Voigt material; strength is an assumption"
    parameters = {"c": Parameter(0.0, "N m s/rad", 0.0, 0.03, source, typical=1e-3)}
    strength = ("c",)
    dissipative = True

    @staticmethod
    def joint_torque(p: Values, joint: int, angle: Scalar, rate: Scalar, xp: Any) -> Scalar:
        return p.c * rate


class TipSlip(Effect):
    """The water holds the tip with a finite lateral grip.

        force = -grip slip,   grip = 1 / mobility

    slip [m/s]: velocity of the tip through the water, normal to the fin. Mobility 0 is no slip.
    """

    name = "tip_slip"
    kind = "physics"
    equation = "lateral force on the tip = -slip / mobility (nominal: no slip)"
    source = (
        "lateral drag of a finite fin instead of the no-slip constraint; strength is an assumption"
    )
    parameters = {"mobility": Parameter(0.0, "m/(N s)", 0.0, 10.0, source, typical=1.0 / 6.0)}
    strength = ("mobility",)

    @staticmethod
    def grip(p: Values, z: Values, xp: Any) -> Grip:
        return Grip(p.mobility)

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        return {"grip": (1.0 / p.mobility if p.mobility > 0 else float("inf"), "N s/m")}


class WakeMemory(Effect):
    """The shed wake lets a share of the grip force follow the slip with a time constant.

        force = -((1 - share) slip + share wake) / mobility,   wake' = (slip - wake) / time_constant

    slip, wake [m/s]. Share 0 is `tip_slip`; mobility 0 and share 0 are the no-slip constraint.
    """

    name = "wake_memory"
    kind = "physics"
    equation = (
        "tip force = -((1 - share) slip + share wake)/mobility, wake' = (slip - wake)/time_constant"
    )
    source = (
        "one-lag approximation of Wagner's lift build-up (Fung 1955); strengths are an assumption"
    )
    parameters = {
        "mobility": Parameter(0.0, "m/(N s)", 0.0, 10.0, source, typical=1.0 / 8.0),
        "share": Parameter(0.0, "1", 0.0, 0.95, source, typical=0.5),
        "time_constant": Parameter(0.3, "s", 0.02, 10.0, source),
    }
    strength = ("mobility", "share")
    states = ("wake",)

    @staticmethod
    def grip(p: Values, z: Values, xp: Any) -> Grip:
        return Grip(p.mobility, p.share, p.share * z.wake)

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        return ((slip - z.wake) / p.time_constant,)

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        return {"grip": (1.0 / p.mobility if p.mobility > 0 else float("inf"), "N s/m")}
