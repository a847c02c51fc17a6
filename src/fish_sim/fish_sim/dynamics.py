# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planar fish: Kane's equations with Kirchhoff added mass and a tip that does not slide sideways.

    M(q) q'' + h(q, q') = Q + N^T lambda,    N q' = n . (v_tip - V_water) = 0

q = (x, y, theta_head, theta_1 .. theta_n): head's centre of mass in the pool frame, head's heading, absolute link
angles; link 1 hangs on the head. Written once, on generic scalars: `xp` is a table of `fish_sim.ops`, every quantity
is one scalar (a float, a batch of numbers, a CasADi symbol). Velocities in added mass, drag and tip constraint are
relative to the water; rigid mass moves in the inertial frame.
Source: the project's model description; added mass after Kirchhoff (Fossen 2021, sect. 6.3) including Munk moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from fish_sim.chain import (
    Body,
    Chain,
    EnabledEffect,
    Pair,
    Place,
    along,
    build_chain,
    inner,
    plus,
    turned,
)
from fish_sim.effects.effect import BodyMotion, Drive, Grip
from fish_sim.ops import Scalar, back_substitute, dot, factorise, reduce

# 1/s, Baumgarte rate of the tip constraint: slip decays within 10 ms; RK4 at 10 ms is stable up to 278
SLIP_DECAY = 100.0
STIFF_GRIP = 8.0  # the blend of constraint and grip fades beyond 1/8 of the mobility A / SLIP_DECAY


@dataclass(frozen=True)
class Solution:
    """What the equations answer at one instant."""

    acceleration: list[Scalar]  # q''
    tip_force: Scalar  # N, lambda, along the fin's left normal
    slip: Scalar  # m/s, lateral velocity of the tip through the water
    state_rates: list[Scalar]  # derivatives of the effects' states, in order


def water_at(place: Place, effects: Sequence[EnabledEffect], xp: Any) -> tuple[Pair, Pair] | None:
    """Water velocity at a point and its rate of change along the point's path, or None in still water."""
    x, y = place.position
    vx, vy = place.velocity
    total: list[Scalar] | None = None
    for e in effects:
        field = e.effect.water(e.p, x, y, e.z, xp)
        if field is None:
            continue
        flow, ((xx, xy), (yx, yy)) = field
        terms = [flow[0], flow[1], xx * vx + xy * vy, yx * vx + yy * vy]
        total = terms if total is None else [a + b for a, b in zip(total, terms, strict=True)]
    return None if total is None else ((total[0], total[1]), (total[2], total[3]))


@dataclass(frozen=True)
class Inertia:
    """m 1 + R diag(A_u, A_v) R^T in the pool frame [kg]: rigid mass and the body's anisotropic added mass."""

    xx: Scalar = 0.0
    xy: Scalar = 0.0
    yy: Scalar = 0.0

    def __add__(self, other: Inertia) -> Inertia:
        return Inertia(self.xx + other.xx, self.xy + other.xy, self.yy + other.yy)

    def times(self, v: Pair) -> Pair:
        return self.xx * v[0] + self.xy * v[1], self.xy * v[0] + self.yy * v[1]


def body_inertia(body: Body, cos: Scalar, sin: Scalar) -> Inertia:
    """Rigid and added mass of a body that points along (cos, sin)."""
    across, anisotropy = body.mass + body.added_sway, body.added_surge - body.added_sway
    return Inertia(
        across + anisotropy * cos**2, anisotropy * (cos * sin), across + anisotropy * sin**2
    )


def body_bias(
    body: Body,
    inertia: Inertia,
    chain: Chain,
    drive: Drive,
    effects: Sequence[EnabledEffect],
    xp: Any,
) -> tuple[Pair, Scalar]:
    """Force (pool frame) and moment about its centre of mass that a body's motion with q'' = 0 asks for, [N, N m].

    Rigid mass and added mass (A_u, A_v) resist the acceleration; with velocity (u, v) through the water and rate of
    turn w Kirchhoff's equations add, in the body's frame,
    X = (A_u - A_v) w v, Y = (A_u - A_v) w u, N = (A_v - A_u) u v (the Munk moment); drag is c_u u, c_v v, c_w w.
    """
    cos, sin, w = chain.cos[body.angle], chain.sin[body.angle], chain.rate[body.angle]
    place = chain.place(body)
    (vx, vy), force = place.velocity, inertia.times(place.acceleration)
    water = water_at(place, effects, xp)
    if water is not None:  # only added mass and drag feel it
        (Vx, Vy), (Ax, Ay) = water
        Fx, Fy = inertia.times((Ax, Ay))
        vx, vy = vx - Vx, vy - Vy
        force = force[0] - Fx + body.mass * Ax, force[1] - Fy + body.mass * Ay
    u, v = vx * cos + vy * sin, vy * cos - vx * sin
    anisotropy = body.added_surge - body.added_sway
    X = anisotropy * w * v + body.drag_surge * u
    Y = anisotropy * w * u + body.drag_sway * v
    N = -anisotropy * u * v + body.drag_yaw * w
    motion = BodyMotion(
        body.name,
        *place.position,
        cos,
        sin,
        u,
        v,
        w,
        body.drag_surge,
        body.drag_sway,
        body.drag_yaw,
    )
    for e in effects:
        extra = e.effect.wrench(e.p, motion, e.z, drive, xp)
        if extra is not None:
            X, Y, N = X - extra[0], Y - extra[1], N - extra[2]
    return plus(force, along(X, Y, cos, sin)), N


def assemble(
    chain: Chain, drive: Drive, effects: Sequence[EnabledEffect], xp: Any
) -> tuple[list[list[Scalar]], list[Scalar]]:
    """Lower triangle of M and the bias h of all bodies over (x, y, theta_head, theta_1 .. theta_n).

    Composite rigid bodies (Walker and Orin 1982), from the fin to the head: what angle k turns is its own bodies, and
    everything behind joint k + 1 as one mass at that joint.
    """
    outer, outer_force = Inertia(), (0.0, 0.0)
    size = len(chain.rate) + 2
    M: list[list[Scalar]] = [[0.0] * size for _ in range(size)]
    h: list[Scalar] = [0.0] * size
    for k in reversed(range(len(chain.rate))):
        arm = turned(chain.arms[k])
        momentum = outer.times(arm)
        turn, moment = inner(arm, momentum), inner(arm, outer_force)
        for body in chain.bodies:
            if body.angle != k:
                continue
            lever = turned(chain.lever(body))
            inertia = body_inertia(body, chain.cos[k], chain.sin[k])
            force, N = body_bias(body, inertia, chain, drive, effects, xp)
            own = inertia.times(lever)
            momentum = plus(momentum, own)
            turn, moment = turn + inner(lever, own) + body.inertia, moment + inner(lever, force) + N
            outer, outer_force = outer + inertia, plus(outer_force, force)
        M[2 + k][:2] = momentum
        M[2 + k][2 : 2 + k] = [inner(turned(a), momentum) for a in chain.arms[:k]]
        M[2 + k][2 + k], h[2 + k] = turn, moment
    M[0][0], M[1][0], M[1][1] = outer.xx, outer.xy, outer.yy
    h[:2] = outer_force
    return turn_fin_with_last_link(M, h)


def turn_fin_with_last_link(
    M: list[list[Scalar]], h: list[Scalar]
) -> tuple[list[list[Scalar]], list[Scalar]]:
    """The fin's angle is no coordinate: its row and column belong to the last link's."""
    fin, bias = M.pop(), h.pop()
    last = len(M) - 1
    M[last][last] = M[last][last] + 2 * fin[last] + fin[last + 1]
    M[last][:last] = [a + b for a, b in zip(M[last][:last], fin[:last], strict=True)]
    h[last] = h[last] + bias
    return M, h


def add_springs(
    h: list[Scalar],
    q: Sequence[Scalar],
    chain: Chain,
    drive: Drive,
    r: SimpleNamespace,
    effects: Sequence[EnabledEffect],
    xp: Any,
) -> None:
    """Tail springs k phi_i and what effects add at the joints; the servo moves the rest of joint 1 to -alpha."""
    root = 1.0 - sum((e.effect.tip_share(e.p) for e in effects), 0.0)
    for i in range(1, chain.links + 1):
        angle, rate = q[2 + i] - q[1 + i], chain.rate[i] - chain.rate[i - 1]
        if i == 1:
            angle, rate = angle + root * drive.alpha, rate + root * drive.alpha_dot
        torque = r.tail_stiffness * angle
        for e in effects:
            torque = torque + e.effect.joint_torque(e.p, i, angle, rate, xp)
        h[2 + i] = h[2 + i] + torque
        h[1 + i] = h[1 + i] - torque


def tip_force(slip: Scalar, A: Scalar, b: Scalar, grip: Grip | None, xp: Any) -> Scalar:
    """Lateral force of the water on the tip, slip' = A lambda + b.

    No slip:       lambda = -(b + slip / tau) / A,          tau = 1 / SLIP_DECAY (Baumgarte)
    Finite grip g: lambda = -g slip,                        mobility s = 1/g
    Both in one:   lambda = -(slip + tau b) / (s + tau A),  tau -> 0 once s is well above A / SLIP_DECAY, so that
    zero mobility is exactly the constraint and a tip that is soft enough to be integrated is exactly the explicit law.
    """
    tau = 1.0 / SLIP_DECAY
    if grip is None:
        return -(b + slip / tau) / A
    held = 1.0 - grip.share
    tau = tau * xp.exp(-((STIFF_GRIP * grip.mobility / (A * tau)) ** 2))
    return -(held * (slip + tau * b) + grip.late) / (grip.mobility + held * tau * A)


def solve(
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    drive: Drive,
    r: SimpleNamespace,
    effects: Sequence[EnabledEffect],
    xp: Any,
    constrained: bool = True,
) -> Solution:
    """Accelerations, tip force and effect state rates at one instant.

    q, qd: n + 3 scalars [m, rad], [m/s, rad/s]; r: nominal parameters by name; constrained=False frees the tip.
    With M = L D L^T everything that M^-1 is needed for meets in the coordinates L^-1.
    """
    chain = build_chain(q, qd, drive, r, effects, xp)
    M, h = assemble(chain, drive, effects, xp)
    add_springs(h, q, chain, drive, r, effects, xp)
    h[2] = h[2] + r.rotor_inertia * drive.rotor_acceleration
    L, inverse = factorise(M)
    free = reduce(L, [-value for value in h])
    ahead = chain.cos[-1], chain.sin[-1]
    velocity, acceleration = chain.tip.velocity, chain.tip.acceleration
    water = water_at(chain.tip, effects, xp)
    if water is not None:
        velocity, acceleration = plus(velocity, water[0], -1.0), plus(acceleration, water[1], -1.0)
    slip = inner(velocity, turned(ahead))
    rates = [rate for e in effects for rate in e.effect.derivative(e.p, e.z, slip, drive, xp)]
    if not constrained:
        return Solution(back_substitute(L, inverse, free), 0.0, slip, rates)
    response = reduce(L, tip_normal(chain))
    weighted = [value * d for value, d in zip(response, inverse, strict=True)]
    A = dot(weighted, response)
    b = (
        dot(weighted, free)
        + inner(acceleration, turned(ahead))
        - chain.rate[-1] * inner(velocity, ahead)
    )
    grips = [g for e in effects if (g := e.effect.grip(e.p, e.z, xp)) is not None]
    force = tip_force(slip, A, b, combine(grips), xp)
    held = [f + force * m for f, m in zip(free, response, strict=True)]
    return Solution(back_substitute(L, inverse, held), force, slip, rates)


def tip_normal(chain: Chain) -> list[Scalar]:
    """N = d(slip)/d(q'): the fin's left normal against the motion that each coordinate gives the tip."""
    normal = turned((chain.cos[-1], chain.sin[-1]))
    angles = [inner(normal, turned(arm)) for arm in chain.arms]
    return [*normal, *angles[:-2], angles[-2] + angles[-1]]


def combine(grips: Sequence[Grip]) -> Grip | None:
    """Several finite grips in one: mobilities add, as in series, and so do shares, then of the whole slip, and what is late."""
    if not grips:
        return None
    return Grip(
        *(sum((getattr(g, part) for g in grips), 0.0) for part in ("mobility", "share", "late"))
    )


def energy(
    q: Sequence[Scalar], qd: Sequence[Scalar], alpha: Scalar, r: SimpleNamespace, xp: Any
) -> Scalar:
    """T + V of the nominal fish in still water [J]; T includes the added mass."""
    zero = Drive(alpha, 0.0, 0.0, 0.0)
    chain = build_chain(q, qd, zero, r, (), xp)
    total = 0.0
    for body in chain.bodies:
        cos, sin = chain.cos[body.angle], chain.sin[body.angle]
        vx, vy = chain.place(body).velocity
        u, v = vx * cos + vy * sin, vy * cos - vx * sin
        total = total + 0.5 * (
            (body.mass + body.added_surge) * u**2 + (body.mass + body.added_sway) * v**2
        )
        total = total + 0.5 * body.inertia * chain.rate[body.angle] ** 2
    for i in range(1, chain.links + 1):
        angle = q[2 + i] - q[1 + i] + (alpha if i == 1 else 0.0)
        total = total + 0.5 * r.tail_stiffness * angle**2
    return total
