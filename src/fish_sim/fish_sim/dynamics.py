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

from fish_sim.effects.effect import BodyMotion, Drive, Effect, Grip
from fish_sim.ops import Scalar

# 1/s, Baumgarte rate of the tip constraint: slip decays within 10 ms; RK4 at 10 ms is stable up to 278
SLIP_DECAY = 100.0
STIFF_GRIP = 8.0  # the blend of constraint and grip fades beyond 1/8 of the mobility A / SLIP_DECAY


@dataclass(frozen=True)
class Point:
    """A material point as a sum of levers: r = (x, y) + sum_k along_k e(theta_k) + left_k e_perp(theta_k)."""

    along: dict[int, Scalar]
    left: dict[int, Scalar]


@dataclass(frozen=True)
class Body:
    """A rigid body on the chain: where, in which direction, how heavy, how draggy."""

    name: str
    angle: int  # index of its direction among the angles
    point: Point
    mass: Scalar
    added_surge: Scalar
    added_sway: Scalar
    inertia: Scalar
    drag_surge: Scalar = 0.0
    drag_sway: Scalar = 0.0
    drag_yaw: Scalar = 0.0


@dataclass(frozen=True)
class Chain:
    """Angles of head (0), links (1..n) and fin (n + 1), their rates, and the bodies that hang on them."""

    x: Scalar
    y: Scalar
    x_dot: Scalar
    y_dot: Scalar
    cos: list[Scalar]
    sin: list[Scalar]
    rate: list[Scalar]
    bodies: list[Body]
    tip: Point

    @property
    def links(self) -> int:
        return len(self.rate) - 2

    def column(self, angle: int) -> int:
        """Index among q of the coordinate that turns this angle; the fin turns with the last link."""
        return 2 + min(angle, self.links)

    def position(self, point: Point) -> tuple[Scalar, Scalar]:
        x, y = self.x, self.y
        for k, arm in point.along.items():
            x, y = x + arm * self.cos[k], y + arm * self.sin[k]
        for k, arm in point.left.items():
            x, y = x - arm * self.sin[k], y + arm * self.cos[k]
        return x, y

    def velocity(self, point: Point) -> tuple[Scalar, Scalar]:
        vx, vy = self.x_dot, self.y_dot
        for k, (jx, jy) in self.lever(point).items():
            vx, vy = vx + jx * self.rate[k], vy + jy * self.rate[k]
        return vx, vy

    def lever(self, point: Point) -> dict[int, tuple[Scalar, Scalar]]:
        """d r / d theta_k for every angle k that moves the point."""
        arms: dict[int, tuple[Scalar, Scalar]] = {}
        for k in {**point.along, **point.left}:
            a, b = point.along.get(k, 0.0), point.left.get(k, 0.0)
            arms[k] = (-a * self.sin[k] - b * self.cos[k], a * self.cos[k] - b * self.sin[k])
        return arms

    def centripetal(self, point: Point) -> tuple[Scalar, Scalar]:
        """Acceleration of the point with all second derivatives zero: -sum theta_k'^2 (r_k)."""
        ax, ay = 0.0, 0.0
        for k, arm in point.along.items():
            ax, ay = ax - arm * self.rate[k] ** 2 * self.cos[k], ay - arm * self.rate[k] ** 2 * self.sin[k]
        for k, arm in point.left.items():
            ax, ay = ax + arm * self.rate[k] ** 2 * self.sin[k], ay - arm * self.rate[k] ** 2 * self.cos[k]
        return ax, ay

    def rows(self, point: Point, cos: Scalar, sin: Scalar) -> tuple[list[Scalar], list[Scalar]]:
        """Jacobian of the point's velocity along (cos, sin) and to its left, over all of q."""
        size = self.links + 3
        along, left = [0.0] * size, [0.0] * size
        along[0], along[1] = cos, sin
        left[0], left[1] = -sin, cos
        for k, (jx, jy) in self.lever(point).items():
            column = self.column(k)
            along[column] = along[column] + (jx * cos + jy * sin)
            left[column] = left[column] + (jy * cos - jx * sin)
        return along, left


@dataclass(frozen=True)
class EnabledEffect:
    """An effect with its parameter values and its own states."""

    effect: type[Effect]
    p: SimpleNamespace
    z: SimpleNamespace


@dataclass(frozen=True)
class Solution:
    """What the equations answer at one instant."""

    acceleration: list[Scalar]  # q''
    tip_force: Scalar  # N, lambda, along the fin's left normal
    slip: Scalar  # m/s, lateral velocity of the tip through the water
    state_rates: list[Scalar]  # derivatives of the effects' states, in order


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
    head = Body(
        "head", 0, Point({}, {}), r.head_mass, r.head_added_mass_surge, r.head_added_mass_sway,
        r.head_inertia, r.head_drag_surge, r.head_drag_sway, r.head_drag_yaw,
    )  # fmt: skip
    bodies, arms = [head], {0: -r.hinge_offset}
    link_inertia = (r.link_mass + r.link_added_mass_sway) * r.link_length**2 / 12
    for i in range(1, n + 1):
        centre = Point({**arms, i: -r.link_length / 2}, {})
        bodies.append(
            Body(
                f"link_{i}", i, centre, r.link_mass, 0.0, r.link_added_mass_sway,
                link_inertia, r.link_drag_surge, r.link_drag_sway,
            )
        )  # fmt: skip
        arms = {**arms, i: -r.link_length}
    fin_inertia = (r.fin_mass + r.fin_added_mass_sway) * r.fin_length**2 / 12
    centre = Point({**arms, n + 1: -r.fin_length / 2}, {})
    bodies.append(
        Body(
            "fin",
            n + 1,
            centre,
            r.fin_mass,
            0.0,
            r.fin_added_mass_sway,
            fin_inertia,
            r.fin_drag_surge,
            r.fin_drag_sway,
        )
    )
    for e in effects:
        for mass, forward, left in e.effect.point_masses(e.p):
            bodies.append(Body(e.effect.name, 0, Point({0: forward}, {0: left}), mass, 0.0, 0.0, 0.0))
    return Chain(
        q[0], q[1], qd[0], qd[1],
        [xp.cos(a) for a in angles], [xp.sin(a) for a in angles], rates, bodies,
        Point({**arms, n + 1: -r.fin_length}, {}),
    )  # fmt: skip


def water_at(chain: Chain, point: Point, effects: Sequence[EnabledEffect], xp: Any) -> tuple[Any, Any] | None:
    """Water velocity at a point and its rate of change along the point's path, or None in still water."""
    x, y = chain.position(point)
    vx, vy = chain.velocity(point)
    total: list[Scalar] | None = None
    for e in effects:
        field = e.effect.water(e.p, x, y, e.z, xp)
        if field is None:
            continue
        flow, ((xx, xy), (yx, yy)) = field
        terms = [flow[0], flow[1], xx * vx + xy * vy, yx * vx + yy * vy]
        total = terms if total is None else [a + b for a, b in zip(total, terms, strict=True)]
    return None if total is None else ((total[0], total[1]), (total[2], total[3]))


def add_body(
    M: list[list[Scalar]],
    h: list[Scalar],
    chain: Chain,
    body: Body,
    drive: Drive,
    effects: Sequence[EnabledEffect],
    xp: Any,
) -> None:
    """Add one body's inertia to M and its inertial bias minus its fluid wrench to h.

    Rigid: m a. Added mass (A_u, A_v), velocity (u, v) and acceleration relative to the water, Kirchhoff:
    X = A_u a_u + (A_u - A_v) w v, Y = A_v a_v + (A_u - A_v) w u, N = (A_v - A_u) u v (the Munk moment).
    """
    cos, sin, w = chain.cos[body.angle], chain.sin[body.angle], chain.rate[body.angle]
    along, left = chain.rows(body.point, cos, sin)
    vx, vy = chain.velocity(body.point)
    ax, ay = chain.centripetal(body.point)
    X = body.mass * (ax * cos + ay * sin)
    Y = body.mass * (ay * cos - ax * sin)
    water = water_at(chain, body.point, effects, xp)
    if water is not None:
        (Vx, Vy), (Ax, Ay) = water
        vx, vy, ax, ay = vx - Vx, vy - Vy, ax - Ax, ay - Ay
    u, v = vx * cos + vy * sin, vy * cos - vx * sin
    a_u, a_v = ax * cos + ay * sin, ay * cos - ax * sin
    anisotropy = body.added_surge - body.added_sway
    X = X + body.added_surge * a_u + anisotropy * w * v + body.drag_surge * u
    Y = Y + body.added_sway * a_v + anisotropy * w * u + body.drag_sway * v
    N = -anisotropy * u * v + body.drag_yaw * w
    motion = BodyMotion(
        body.name,
        *chain.position(body.point),
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
    mass_u, mass_v, turn = body.mass + body.added_surge, body.mass + body.added_sway, chain.column(body.angle)
    moving = [0, 1, *sorted({chain.column(k) for k in {**body.point.along, **body.point.left}} | {turn})]
    for i in moving:
        h[i] = h[i] + along[i] * X + left[i] * Y
        for j in moving:
            M[i][j] = M[i][j] + mass_u * along[i] * along[j] + mass_v * left[i] * left[j]
    M[turn][turn] = M[turn][turn] + body.inertia
    h[turn] = h[turn] + N


def add_springs(
    h: list[Scalar], q: Sequence[Scalar], chain: Chain, drive: Drive, r: SimpleNamespace,
    effects: Sequence[EnabledEffect], xp: Any,
) -> None:  # fmt: skip
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


def factorise(M: list[list[Scalar]]) -> tuple[list[list[Scalar]], list[Scalar]]:
    """M = L D L^T of a symmetric positive definite matrix of scalars: (L strictly lower, 1/D)."""
    size = len(M)
    L: list[list[Scalar]] = [[0.0] * size for _ in range(size)]
    D: list[Scalar] = []
    inverse: list[Scalar] = []
    for j in range(size):
        scaled = [L[j][k] * D[k] for k in range(j)]
        D.append(M[j][j] - sum((scaled[k] * L[j][k] for k in range(j)), 0.0))
        inverse.append(1.0 / D[j])
        for i in range(j + 1, size):
            L[i][j] = (M[i][j] - sum((L[i][k] * scaled[k] for k in range(j)), 0.0)) * inverse[j]
    return L, inverse


def back_substitute(factors: tuple[list[list[Scalar]], list[Scalar]], b: Sequence[Scalar]) -> list[Scalar]:
    """Solve L D L^T x = b."""
    L, inverse = factors
    size = len(b)
    x = list(b)
    for i in range(size):
        for k in range(i):
            x[i] = x[i] - L[i][k] * x[k]
    x = [x[i] * inverse[i] for i in range(size)]
    for i in reversed(range(size)):
        for k in range(i + 1, size):
            x[i] = x[i] - L[k][i] * x[k]
    return x


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
    return -(held * (slip + tau * b) + grip.share * grip.wake) / (grip.mobility + held * tau * A)


def solve(
    q: Sequence[Scalar], qd: Sequence[Scalar], drive: Drive, r: SimpleNamespace,
    effects: Sequence[EnabledEffect], xp: Any, constrained: bool = True,
) -> Solution:  # fmt: skip
    """Accelerations, tip force and effect state rates at one instant.

    q, qd: n + 3 scalars [m, rad], [m/s, rad/s]; r: nominal parameters by name; constrained=False frees the tip.
    """
    size = len(q)
    chain = build_chain(q, qd, drive, r, effects, xp)
    M: list[list[Scalar]] = [[0.0] * size for _ in range(size)]
    h: list[Scalar] = [0.0] * size
    for body in chain.bodies:
        add_body(M, h, chain, body, drive, effects, xp)
    add_springs(h, q, chain, drive, r, effects, xp)
    h[2] = h[2] + r.rotor_inertia * drive.rotor_acceleration
    factors = factorise(M)
    free = back_substitute(factors, [-value for value in h])
    fin = chain.links + 1
    cos, sin = chain.cos[fin], chain.sin[fin]
    along, normal = chain.rows(chain.tip, cos, sin)
    vx, vy = chain.velocity(chain.tip)
    ax, ay = chain.centripetal(chain.tip)
    water = water_at(chain, chain.tip, effects, xp)
    if water is not None:
        (Vx, Vy), (Ax, Ay) = water
        vx, vy, ax, ay = vx - Vx, vy - Vy, ax - Ax, ay - Ay
    slip = vy * cos - vx * sin
    rates = [rate for e in effects for rate in e.effect.derivative(e.p, e.z, slip, drive, xp)]
    if not constrained:
        return Solution(free, 0.0, slip, rates)
    response = back_substitute(factors, normal)
    A = dot(normal, response)
    b = dot(normal, free) + ay * cos - ax * sin - chain.rate[fin] * (vx * cos + vy * sin)
    grips = [g for e in effects if (g := e.effect.grip(e.p, e.z, xp)) is not None]
    force = tip_force(slip, A, b, combine(grips), xp)
    return Solution([f + force * m for f, m in zip(free, response, strict=True)], force, slip, rates)


def combine(grips: Sequence[Grip]) -> Grip | None:
    """Several finite grips act in series: mobilities add; late shares add."""
    if not grips:
        return None
    share = sum((g.share for g in grips), 0.0)
    return Grip(sum((g.mobility for g in grips), 0.0), share, sum((g.wake for g in grips), 0.0))


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Inner product of two lists of scalars."""
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)


def energy(q: Sequence[Scalar], qd: Sequence[Scalar], alpha: Scalar, r: SimpleNamespace, xp: Any) -> Scalar:
    """T + V of the nominal fish in still water [J]; T includes the added mass."""
    zero = Drive(alpha, 0.0, 0.0, 0.0)
    chain = build_chain(q, qd, zero, r, (), xp)
    total = 0.0
    for body in chain.bodies:
        cos, sin = chain.cos[body.angle], chain.sin[body.angle]
        vx, vy = chain.velocity(body.point)
        u, v = vx * cos + vy * sin, vy * cos - vx * sin
        total = total + 0.5 * ((body.mass + body.added_surge) * u**2 + (body.mass + body.added_sway) * v**2)
        total = total + 0.5 * body.inertia * chain.rate[body.angle] ** 2
    for i in range(1, chain.links + 1):
        angle = q[2 + i] - q[1 + i] + (alpha if i == 1 else 0.0)
        total = total + 0.5 * r.tail_stiffness * angle**2
    return total
