# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an effect may add to the nominal model, and what it may look at.

An effect is one class: parameters, optional states and only those methods in which it differs from the
nominal model. All methods are written on generic scalars (`xp` of `fish_sim.ops`). With zero strength an
effect is exactly the nominal model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter

Values = SimpleNamespace  # of parameters, states or memory, by name
Wrench = tuple[Scalar, Scalar, Scalar]  # X, Y [N], N [N m] in the frame of a body
Pair = tuple[Scalar, Scalar]
Flow = tuple[Pair, tuple[Pair, Pair]]  # water velocity [m/s] and its gradient [1/s]
Followed = tuple[Scalar, dict[str, Scalar]]  # what becomes of a command, and the memory after it


@dataclass(frozen=True)
class BodyMotion:
    """One rigid body (head, link_1.., fin) as the forces see it."""

    name: str
    x: Scalar  # m, centre of mass in the pool frame
    y: Scalar  # m
    cos: Scalar  # of its direction in the pool frame
    sin: Scalar
    u: Scalar  # m/s, surge relative to the water, body frame
    v: Scalar  # m/s, sway relative to the water, body frame
    w: Scalar  # rad/s, rate of turn
    drag_surge: Scalar  # N s/m, nominal Rayleigh coefficients
    drag_sway: Scalar  # N s/m
    drag_yaw: Scalar  # N m s/rad


@dataclass(frozen=True)
class Drive:
    """The inputs inside one step: both piecewise linear in time."""

    alpha: Scalar  # rad, rudder angle, > 0 steers left
    alpha_dot: Scalar  # rad/s
    rotor_speed: Scalar  # rad/s, phi_dot
    rotor_acceleration: Scalar  # rad/s^2, phi_ddot


@dataclass(frozen=True)
class Grip:
    """How the tail's tip holds the water: force = -((1 - share) slip + late) / mobility.

    mobility 0 is the no-slip constraint of the nominal model.
    """

    mobility: Scalar = 0.0  # m/(N s)
    share: Scalar = 0.0  # part of the grip that follows the slip late
    late: Scalar = 0.0  # m/s, that share of the slip as it was


class Effect:
    """Base of all effects: everything nominal. Subclasses override what they change."""

    name: ClassVar[str]
    kind: ClassVar[str]  # physics, actuator
    equation: ClassVar[str]
    source: ClassVar[str]
    parameters: ClassVar[Mapping[str, Parameter]]
    strength: ClassVar[
        tuple[str, ...]
    ]  # parameters whose default (zero or neutral) value means: effect off
    states: ClassVar[tuple[str, ...]] = ()  # continuous, integrated with the motion; start at 0
    memory: ClassVar[tuple[str, ...]] = ()  # discrete, updated once per command; start at 0
    has_linkage: ClassVar[bool] = (
        False  # servo and rudder differ: the servo's position is remembered too
    )
    dissipative: ClassVar[bool] = False  # its wrench never adds energy in still water

    @staticmethod
    def wrench(p: Values, body: BodyMotion, z: Values, drive: Drive, xp: Any) -> Wrench | None:
        """(X, Y, N) on a body in its own frame [N, N, N m]."""
        return None

    @staticmethod
    def joint_torque(p: Values, joint: int, angle: Scalar, rate: Scalar, xp: Any) -> Scalar:
        """Torque that opposes the joint's deflection [N m], added to the spring's; joint 1 is at the head."""
        return 0.0

    @staticmethod
    def water(p: Values, x: Scalar, y: Scalar, z: Values, xp: Any) -> Flow | None:
        """Water velocity (V_x, V_y) and gradient ((dVx/dx, dVx/dy), (dVy/dx, dVy/dy)), pool frame."""
        return None

    @staticmethod
    def point_masses(p: Values) -> tuple[tuple[Scalar, Scalar, Scalar], ...]:
        """((mass, forward, left), ..) rigid on the head, relative to its centre of mass [kg, m, m]."""
        return ()

    @staticmethod
    def grip(p: Values, z: Values, xp: Any) -> Grip | None:
        """Finite grip of the tip, or None."""
        return None

    @staticmethod
    def tip_share(p: Values) -> Scalar:
        """Part of alpha that turns the fin at the tip instead of the root of the tail."""
        return 0.0

    @staticmethod
    def derivative(p: Values, z: Values, slip: Scalar, drive: Drive, xp: Any) -> tuple[Scalar, ...]:
        """Time derivatives of `states`; slip is the tip's lateral velocity through the water [m/s]."""
        return ()

    @staticmethod
    def rudder(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        """(commanded alpha as the servo follows it [rad], updated memory)."""
        return command, {}

    @staticmethod
    def servo(p: Values, alpha: Scalar, target: Scalar, dt: float, xp: Any) -> Scalar:
        """Where a servo at alpha would be one period later but for its rate limit [rad]."""
        return target

    @staticmethod
    def linkage(p: Values, m: Values, servo: Scalar, dt: float, xp: Any) -> Followed:
        """(rudder angle that a servo's position gives [rad], updated memory); effects with one set `has_linkage`."""
        return servo, {}

    @staticmethod
    def rotor(p: Values, m: Values, command: Scalar, dt: float, xp: Any) -> Followed:
        """(commanded rotor speed as the motor follows it [rad/s], updated memory)."""
        return command, {}

    @staticmethod
    def derived(p: Values) -> Mapping[str, tuple[float, str]]:
        """Numbers people know better than the parameters: name -> (value, unit). For reports only."""
        return {}
