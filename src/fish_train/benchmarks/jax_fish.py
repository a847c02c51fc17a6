# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The nominal fish of three links on whole arrays of JAX (bodies x coordinates x fish).

XLA runs the project's scalar form several times slower.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from fish_sim.dynamics import SLIP_DECAY

COORDINATES = 6  # x, y, head, three links
ANGLES = np.array([2, 3, 4, 5, 5])  # of head, links, fin among the coordinates
LENGTH = np.array([0, 1, 1, 1, 2])  # which length reaches back along each angle
DIRECTION = np.array([0, 1, 2, 3, 4, 4])  # angle of each body, and of the tip
TURN = np.array([2, 3, 4, 5, 5])  # coordinate that turns each body
ARM = np.array(
    [  # of body centres and tip, in lengths along each angle
        [0, 0, 0, 0, 0],
        [1, 0.5, 0, 0, 0],
        [1, 1, 0.5, 0, 0],
        [1, 1, 1, 0.5, 0],
        [1, 1, 1, 1, 0.5],
        [1, 1, 1, 1, 1],
    ]
)


def motion_rates(
    x: jax.Array, drive: jax.Array, drive_rate: jax.Array, p: dict[str, jax.Array]
) -> jax.Array:
    """Time derivative of (q, q') (12, B) of the nominal fish with three links: fish_sim.dynamics on arrays.

    Rows of bodies: head, links 1 to 3, fin, and the tip; columns of angles: head, links, fin.
    """
    q, qd = x[:COORDINATES], x[COORDINATES:]
    angle, rate = q[ANGLES], qd[ANGLES]
    cos, sin = jnp.cos(angle), jnp.sin(angle)
    lengths = jnp.stack([p["hinge_offset"], p["link_length"], p["fin_length"]])[
        LENGTH
    ]  # (5 angles, B)
    arm = -ARM[..., None] * lengths  # (6, 5, B)
    jx, jy = -arm * sin, arm * cos
    J = []
    for unit, j in (([1.0, 0.0], jx), ([0.0, 1.0], jy)):
        base = jnp.broadcast_to(np.array(unit)[None, :, None], (6, 2, x.shape[1]))
        J.append(jnp.concatenate([base, j[:, :3], j[:, 3:4] + j[:, 4:5]], axis=1))
    c, s = cos[DIRECTION][:, None], sin[DIRECTION][:, None]
    along, left = J[0] * c + J[1] * s, J[1] * c - J[0] * s  # (6, 6, B)
    u, v = (along * qd).sum(axis=1), (left * qd).sum(axis=1)
    ax, ay = (-arm * rate**2 * cos).sum(axis=1), (-arm * rate**2 * sin).sum(axis=1)
    a_u, a_v = ax * c[:, 0] + ay * s[:, 0], ay * c[:, 0] - ax * s[:, 0]
    w, body = rate[DIRECTION[:5]], slice(0, 5)
    mass, surge, sway, inertia, c_u, c_v, c_w = _bodies(p)
    skew = surge - sway
    X = (mass + surge) * a_u[body] + skew * w * v[body] + c_u * u[body]
    Y = (mass + sway) * a_v[body] + skew * w * u[body] + c_v * v[body]
    N = -skew * u[body] * v[body] + c_w * w
    bend = jnp.diff(q[2:], axis=0).at[0].add(drive[0]) * p["tail_stiffness"]
    h = (along[body] * X[:, None] + left[body] * Y[:, None]).sum(axis=0)
    h = (
        h.at[TURN]
        .add(N)
        .at[3:]
        .add(bend)
        .at[2:5]
        .add(-bend)
        .at[2]
        .add(p["rotor_inertia"] * drive_rate[1])
    )
    mu, mv = (mass + surge)[:, None, None], (mass + sway)[:, None, None]
    M = (
        mu * along[body, :, None] * along[body, None] + mv * left[body, :, None] * left[body, None]
    ).sum(axis=0)
    M = M.at[TURN, TURN].add(inertia)
    free, response = _solve(M, jnp.stack([-h, left[5]], axis=1))
    slip, course = v[5], u[5]
    A = (left[5] * response).sum(axis=0)
    b = (left[5] * free).sum(axis=0) + a_v[5] - rate[4] * course
    force = -(b + slip * SLIP_DECAY) / A
    return jnp.concatenate([qd, free + force * response])


def _bodies(p: dict[str, jax.Array]) -> tuple[jax.Array, ...]:
    """Mass, added surge, added sway, inertia and drags of the five bodies, each (5, B)."""
    zero = jnp.zeros_like(p["head_mass"])
    links = {k: p[f"link_{k}"] for k in ("mass", "added_mass_sway", "drag_surge", "drag_sway")}
    fin = {k: p[f"fin_{k}"] for k in links}

    def each(head: jax.Array, name: str) -> jax.Array:
        return jnp.stack([head, *[links[name]] * 3, fin[name]])

    mass, sway = each(p["head_mass"], "mass"), each(p["head_added_mass_sway"], "added_mass_sway")
    lengths = jnp.stack([zero, *[p["link_length"]] * 3, p["fin_length"]])
    factor = jnp.stack([zero, *[p["link_inertia_factor"]] * 3, p["fin_inertia_factor"]])
    inertia = (factor * (mass + sway) * lengths**2 / 12).at[0].set(p["head_inertia"])
    surge = jnp.stack([p["head_added_mass_surge"], *[zero] * 4])
    drags = each(p["head_drag_surge"], "drag_surge"), each(p["head_drag_sway"], "drag_sway")
    return mass, surge, sway, inertia, *drags, jnp.stack([p["head_drag_yaw"], *[zero] * 4])


def _solve(M: jax.Array, rhs: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Gauss-Jordan without pivoting (M is positive definite): M (6, 6, B), rhs (6, 2, B)."""
    rows = jnp.concatenate([M, rhs], axis=1)
    for k in range(COORDINATES):
        pivot = rows[k] / rows[k, k]
        rows = (rows - rows[:, k, None] * pivot).at[k].set(pivot)
    return rows[:, COORDINATES], rows[:, COORDINATES + 1]
