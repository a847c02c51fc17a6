# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The chain of rigid bodies: where head, links, fin and what is fixed to the head are, and how they move.

q = (x, y, theta_head, theta_1 .. theta_n), absolute angles in the pool frame; link 1 hangs on the head and the fin on the
last link. Every quantity is one scalar (a float, a batch of numbers, a CasADi symbol).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from fish_sim.effects.effect import Drive, Effect
from fish_sim.ops import Scalar

Pair = tuple[Scalar, Scalar]


@dataclass(frozen=True)
class Place:
    """A material point in the pool frame: where it is, how it moves, how it accelerates while q'' = 0."""

    position: Pair  # m
    velocity: Pair  # m/s
    acceleration: Pair  # m/s^2, centripetal: -sum_k theta_k'^2 lever_k


@dataclass(frozen=True)
class Body:
    """A rigid body on the chain: where, in which direction, how heavy, how draggy."""

    name: str
    angle: int  # index of its direction among the angles
    forward: Scalar  # m, its centre of mass from the joint that carries its angle
    left: Scalar
    mass: Scalar
    added_surge: Scalar
    added_sway: Scalar
    inertia: Scalar
    drag_surge: Scalar = 0.0
    drag_sway: Scalar = 0.0
    drag_yaw: Scalar = 0.0


@dataclass(frozen=True)
class Chain:
    """Angles of head (0), links (1..n) and fin (n + 1), the joints that carry them, and the bodies on them.

    Joint 0 is the head's centre of mass, joint n + 2 the tip; arm k leads from joint k to joint k + 1.
    """

    cos: list[Scalar]
    sin: list[Scalar]
    rate: list[Scalar]
    arms: list[Pair]  # m, pool frame
    joints: list[Place]
    bodies: list[Body]

    @property
    def links(self) -> int:
        return len(self.rate) - 2

    @property
    def tip(self) -> Place:
        return self.joints[-1]

    def lever(self, body: Body) -> Pair:
        """From the joint to the body's centre of mass [m], pool frame."""
        return along(body.forward, body.left, self.cos[body.angle], self.sin[body.angle])

    def place(self, body: Body) -> Place:
        return carried(self.joints[body.angle], self.lever(body), self.rate[body.angle])


def along(forward: Scalar, left: Scalar, cos: Scalar, sin: Scalar) -> Pair:
    """A vector of the frame that points along (cos, sin), in the pool frame."""
    return forward * cos - left * sin, forward * sin + left * cos


def turned(v: Pair) -> Pair:
    """A quarter turn to the left: how a lever's end moves per rate of turn."""
    return -v[1], v[0]


def inner(a: Pair, b: Pair) -> Scalar:
    return a[0] * b[0] + a[1] * b[1]


def plus(a: Pair, b: Pair, factor: Scalar = 1.0) -> Pair:
    """a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1]


def carried(joint: Place, lever: Pair, rate: Scalar) -> Place:
    """The point at the end of a lever that turns about a joint."""
    return Place(
        plus(joint.position, lever),
        plus(joint.velocity, turned(lever), rate),
        plus(joint.acceleration, lever, -(rate**2)),
    )


@dataclass(frozen=True)
class EnabledEffect:
    """An effect with its parameter values and its own states."""

    effect: type[Effect]
    p: SimpleNamespace
    z: SimpleNamespace


def build_chain(
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    drive: Drive,
    r: SimpleNamespace,
    effects: Sequence[EnabledEffect],
    xp: Any,
) -> Chain:
    """Place head, links, fin and what the effects fix to the head."""
    n = len(q) - 3
    share = sum((e.effect.tip_share(e.p) for e in effects), 0.0)
    angles = [*q[2:], q[2 + n] - share * drive.alpha]
    rates = [*qd[2:], qd[2 + n] - share * drive.alpha_dot]
    cos, sin = [xp.cos(a) for a in angles], [xp.sin(a) for a in angles]
    lengths = [r.hinge_offset, *[r.link_length] * n, r.fin_length]
    arms = [along(-length, 0.0, c, s) for length, c, s in zip(lengths, cos, sin, strict=True)]
    joints = [Place((q[0], q[1]), (qd[0], qd[1]), (0.0, 0.0))]
    for arm, rate in zip(arms, rates, strict=True):
        joints.append(carried(joints[-1], arm, rate))
    return Chain(cos, sin, rates, arms, joints, build_bodies(n, r, effects))


def build_bodies(n: int, r: SimpleNamespace, effects: Sequence[EnabledEffect]) -> list[Body]:
    """Head, links, fin, then what the effects fix to the head."""
    link_inertia = (
        r.link_inertia_factor * (r.link_mass + r.link_added_mass_sway) * r.link_length**2 / 12
    )
    fin_inertia = r.fin_inertia_factor * (r.fin_mass + r.fin_added_mass_sway) * r.fin_length**2 / 12
    head = Body(
        "head",
        0,
        0.0,
        0.0,
        r.head_mass,
        r.head_added_mass_surge,
        r.head_added_mass_sway,
        r.head_inertia,
        r.head_drag_surge,
        r.head_drag_sway,
        r.head_drag_yaw,
    )
    links = [
        Body(
            f"link_{i}",
            i,
            -r.link_length / 2,
            0.0,
            r.link_mass,
            0.0,
            r.link_added_mass_sway,
            link_inertia,
            r.link_drag_surge,
            r.link_drag_sway,
        )
        for i in range(1, n + 1)
    ]
    fin = Body(
        "fin",
        n + 1,
        -r.fin_length / 2,
        0.0,
        r.fin_mass,
        0.0,
        r.fin_added_mass_sway,
        fin_inertia,
        r.fin_drag_surge,
        r.fin_drag_sway,
    )
    points = [
        Body(e.effect.name, 0, forward, left, mass, 0.0, 0.0, 0.0)
        for e in effects
        for mass, forward, left in e.effect.point_masses(e.p)
    ]
    return [head, *links, fin, *points]
