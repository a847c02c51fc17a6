# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fish once more, from its Lagrangian by automatic differentiation: an answer independent of `dynamics`.

    d/dt dT/dq' - dT/dq + dV/dq + dR/dq' = rotor reaction + N^T lambda,   N q' = 0

T, V, R are written in pool coordinates with torch; no mass matrix, no Coriolis term, no Munk moment appears.
"""

import torch
from torch.func import grad, hessian, jacrev, jvp


def places(q, alpha, r, share):
    """Centres of mass (head, links, fin), directions of the bodies, and the tip: (B, 2), (B,), (2,)."""
    n = len(q) - 3
    angles = torch.cat([q[2:], (q[2 + n] - share * alpha)[None]])
    e = torch.stack([angles.cos(), angles.sin()], -1)
    lengths = torch.tensor([r["link_length"]] * n + [r["fin_length"]], dtype=q.dtype)
    ends = q[:2] - r["hinge_offset"] * e[0] - torch.cumsum(lengths[:, None] * e[1:], 0)
    middles = ends + 0.5 * lengths[:, None] * e[1:]
    return torch.cat([q[None, :2], middles]), angles, ends[-1]


def body_velocities(q, qd, alpha, alpha_dot, r, share):
    """Surge, sway and turn of every body, lateral velocity of the tip."""

    def track(q, alpha):
        return places(q, alpha, r, share)

    (_, angles, _), (v, w, v_tip) = jvp(track, (q, alpha), (qd, alpha_dot))
    along = torch.stack([angles.cos(), angles.sin()], -1)
    left = torch.stack([-angles.sin(), angles.cos()], -1)
    return (v * along).sum(-1), (v * left).sum(-1), w, v_tip @ left[-1]


def table(r, n):
    """Per body: mass + added surge, mass + added sway, inertia, drags (surge, sway, yaw)."""
    link = r["link_mass"] + r["link_added_mass_sway"]
    fin = r["fin_mass"] + r["fin_added_mass_sway"]
    head = [
        r["head_mass"] + r["head_added_mass_surge"],
        r["head_mass"] + r["head_added_mass_sway"],
        r["head_inertia"],
        r["head_drag_surge"],
        r["head_drag_sway"],
        r["head_drag_yaw"],
    ]
    links = [
        [
            r["link_mass"],
            link,
            r["link_inertia_factor"] * link * r["link_length"] ** 2 / 12,
            r["link_drag_surge"],
            r["link_drag_sway"],
            0.0,
        ]
    ] * n
    inertia = r["fin_inertia_factor"] * fin * r["fin_length"] ** 2 / 12
    end = [r["fin_mass"], fin, inertia, r["fin_drag_surge"], r["fin_drag_sway"], 0.0]
    return torch.tensor([head, *links, end], dtype=torch.float64).T


def kinetic_energy(q, qd, alpha, alpha_dot, r, share=0.0):
    """T [J] with added mass."""
    u, v, w, _ = body_velocities(q, qd, alpha, alpha_dot, r, share)
    m_u, m_v, inertia, *_ = table(r, len(q) - 3)
    return 0.5 * (m_u * u**2 + m_v * v**2 + inertia * w**2).sum()


def spring_energy(q, alpha, r, share=0.0):
    """V [J]."""
    bend = q[3:] - q[2:-1]
    rest = torch.zeros_like(bend)
    rest[0] = -(1.0 - share) * alpha
    return 0.5 * r["tail_stiffness"] * ((bend - rest) ** 2).sum()


def accelerations(q, qd, alpha, alpha_dot, rotor_acceleration, r, share=0.0, slip_decay=0.0):
    """(q'', lambda) with alpha'' = 0; slip_decay adds -slip_decay slip to the constraint's derivative."""
    q, qd = torch.as_tensor(q), torch.as_tensor(qd)
    alpha, alpha_dot = (torch.tensor(v, dtype=q.dtype) for v in (alpha, alpha_dot))

    def T(q, qd, alpha):
        return kinetic_energy(q, qd, alpha, alpha_dot, r, share)

    def R(qd):
        u, v, w, _ = body_velocities(q, qd, alpha, alpha_dot, r, share)
        *_, c_u, c_v, c_w = table(r, len(q) - 3)
        return 0.5 * (c_u * u**2 + c_v * v**2 + c_w * w**2).sum()

    def slip(q, qd, alpha):
        return body_velocities(q, qd, alpha, alpha_dot, r, share)[3]

    M = hessian(T, 1)(q, qd, alpha)
    _, drift = jvp(lambda q, a: grad(T, 1)(q, qd, a), (q, alpha), (qd, alpha_dot))
    force = (
        grad(T)(q, qd, alpha)
        - drift
        - grad(lambda q: spring_energy(q, alpha, r, share))(q)
        - grad(R)(qd)
    )
    force[2] -= r["rotor_inertia"] * rotor_acceleration
    N = jacrev(slip, 1)(q, qd, alpha)
    _, bias = jvp(lambda q, a: slip(q, qd, a), (q, alpha), (qd, alpha_dot))
    size = len(q)
    K = torch.zeros(size + 1, size + 1, dtype=q.dtype)
    K[:size, :size], K[size, :size], K[:size, size] = M, N, -N
    right = torch.cat([force, -(bias + slip_decay * slip(q, qd, alpha))[None]])
    solution = torch.linalg.solve(K, right)
    return solution[:size].numpy(), float(solution[size])


def momentum(q, qd, r):
    """Linear impulse [N s] and angular impulse about the pool's centre [N m s]."""
    q, qd = torch.as_tensor(q), torch.as_tensor(qd)
    zero = torch.tensor(0.0, dtype=q.dtype)
    p = grad(lambda v: kinetic_energy(q, v, zero, zero, r))(qd)
    return p[:2].numpy(), float(p[2:].sum() + q[0] * p[1] - q[1] * p[0])
