# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gradient of a training window: compiled kernel against jitted JAX, same equations, same numbers, one core.

    taskset -c 0 python src/fish_train/benchmarks/closed_loop_gradient.py

Needs jax and jaxlib (pip install jax jaxlib), which nothing else in the project uses. The laws and the cost are
the project's own functions traced with jax.numpy; the physics is written anew on whole arrays (bodies x
coordinates x fish), because XLA runs the project's scalar form several times slower; periods, physics steps and
stages run in lax.scan. Prints environment steps (of 20 ms, two physics steps) per second, forward and backward,
and how far both gradients are apart.
"""

from __future__ import annotations

import argparse
import os
import time
from types import SimpleNamespace

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import jax
import jax.numpy as jnp
import numpy as np

from fish_control.path_batch import LOOKAHEAD_SEARCH
from fish_control.paths import make_path
from fish_sim.dynamics import SLIP_DECAY
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.step import Stepper
from fish_train.training.batch_state import BatchState
from fish_train.training.closed_loop_equations import (
    PHYSICS_STEPS,
    SIZES,
    Law,
    act,
    drive,
    motion,
    sense,
)
from fish_train.training.compiled_loop import CompiledLoop
from fish_train.training.network import initial_weights, split
from fish_train.training.path_bank import PathBank

STEPS = 15
COST = np.array([1.0, 10.0, 10.0, 0.1, 0.01, 0.1])
RK4 = np.array(
    [[0.0, 1 / 6, 0.0], [0.5, 1 / 3, 0.5], [0.5, 1 / 3, 0.5], [1.0, 1 / 6, 1.0]]
)  # a, b, c of each stage
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
XP = SimpleNamespace(
    sin=jnp.sin,
    cos=jnp.cos,
    exp=jnp.exp,
    sqrt=jnp.sqrt,
    tanh=jnp.tanh,
    fabs=jnp.abs,
    sign=jnp.sign,
    floor=jnp.floor,
    fmin=jnp.minimum,
    fmax=jnp.maximum,
    arctan2=jnp.arctan2,
    where=jnp.where,
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


class JaxLoop:
    """The window's cost and gradient under jax.jit; perfect state, open or endless paths as in this benchmark."""

    def __init__(self, stepper: Stepper, law: Law, bank: PathBank) -> None:
        self._stepper, self._law = stepper, law
        rows = max(len(t.rows) for t in bank.tables)
        self._rows = jnp.array(
            [np.pad(t.rows, ((0, rows - len(t.rows)), (0, 0)), mode="edge") for t in bank.tables]
        )
        self._spacing = jnp.array([t.spacing for t in bank.tables])
        self._count = jnp.array([t.count if t.closed else 10**9 for t in bank.tables])
        self._last = jnp.array([len(t.rows) - 1 for t in bank.tables])
        self._lap_end = jnp.array([t.lap_end for t in bank.tables])
        finest = min(t.spacing for t in bank.tables)
        self._near = jnp.arange(int(np.ceil(law.tracker.search_window / finest)) + 1)
        self._far = jnp.arange(int(np.ceil(LOOKAHEAD_SEARCH * law.tracker.lookahead / finest)) + 1)
        self.gradient = jax.jit(jax.value_and_grad(self._cost))

    def _rows_at(self, path: jax.Array, s: jax.Array) -> jax.Array:
        """Table rows at arc lengths s (B, K)."""
        k = jnp.rint(s / self._spacing[path][:, None]).astype(jnp.int32)
        k = jnp.minimum(k % self._count[path][:, None], self._last[path][:, None])
        return self._rows[path[:, None], k]

    def _locate(self, path: jax.Array, place: tuple, x: jax.Array, y: jax.Array) -> tuple:
        """`path_search.locate` for a batch."""
        progress, captured = place
        ds, end = self._spacing[path], self._lap_end[path]
        s = jnp.minimum(progress[:, None] + ds[:, None] * self._near, end[:, None])
        rows = self._rows_at(path, s)
        squared = (rows[..., 0] - x[:, None]) ** 2 + (rows[..., 1] - y[:, None]) ** 2
        best, each = jnp.argmin(squared, axis=1), jnp.arange(len(x))
        captured = captured | (squared[each, best] <= self._law.tracker.capture_distance**2)
        base = jnp.where(captured, s[each, best], progress)
        lowest = jnp.where(captured, jnp.maximum(progress - base, -ds), 0.0)
        highest = jnp.where(captured, jnp.minimum(end - base, ds), 0.0)
        row = self._rows_at(path, base[:, None])[:, 0]
        delta = base - jnp.rint(base / ds) * ds
        mean, heading = row[:, 2] + 0.5 * row[:, 3] * delta, row[:, 2] + row[:, 3] * delta
        bx, by = row[:, 0] + delta * jnp.cos(mean), row[:, 1] + delta * jnp.sin(mean)
        along = jnp.cos(heading) * (x - bx) + jnp.sin(heading) * (y - by)
        progress = base + jnp.clip(along, lowest, highest)
        now = self._rows_at(path, progress[:, None])[:, 0]
        ahead = self._rows_at(path, progress[:, None] + ds[:, None] * self._far)[..., :2]
        distance = jnp.sqrt((ahead[..., 0] - x[:, None]) ** 2 + (ahead[..., 1] - y[:, None]) ** 2)
        leaves = distance >= self._law.tracker.lookahead
        first = jnp.where(
            leaves.any(axis=1), jnp.argmax(leaves, axis=1), jnp.argmax(distance, axis=1)
        )
        a, b = ahead[each, jnp.maximum(first - 1, 0)], ahead[each, first]
        shift = base - jnp.rint(progress / ds) * ds
        geometry = [bx, by, heading, lowest, highest, *now.T, shift, *a.T, *b.T]
        return (progress, captured), [jax.lax.stop_gradient(g) for g in geometry]

    def _physics(self, state: jax.Array, command: jax.Array, p: dict[str, jax.Array]) -> jax.Array:
        """One step of 10 ms; state (NS, B), command (2, B)."""
        size = 2 * COORDINATES
        x, m0 = state[:size], state[size:]
        limit = p["servo_rate_limit"] * DT
        rudder = jnp.clip(command[1], -p["rudder_range"], p["rudder_range"])
        m1 = jnp.stack([m0[0] + jnp.clip(rudder - m0[0], -limit, limit), command[0]])

        def stage(carry: tuple, coefficients: jax.Array) -> tuple[tuple, None]:
            total, k = carry
            a, b, c = coefficients
            k = motion_rates(x + DT * a * k, m0 + (m1 - m0) * c, (m1 - m0) / DT, p)
            return (total + DT * b * k, k), None

        x, _ = jax.lax.scan(stage, (x, jnp.zeros_like(x)), RK4)[0]
        return jnp.concatenate([x, m1])

    def _sense(self, carry: dict, path: jax.Array, speed: jax.Array) -> tuple[tuple, dict]:
        now = self._motion(carry["plant"])
        x, y = (jax.lax.stop_gradient(v) for v in now[:2])
        place, near = self._locate(path, (carry["progress"], carry["captured"]), x, y)
        return place, sense(
            [*carry["before"], *now],
            now,
            list(carry["guidance"]),
            list(carry["last"][SIZES["gains"] :]),
            near,
            near,
            speed,
            COST,
            self._law,
            XP,
        )

    def _motion(self, plant: jax.Array) -> list[jax.Array]:
        return motion(list(plant[:3]), list(plant[COORDINATES : COORDINATES + 3]), XP)

    def _cost(
        self, flat: jax.Array, carry: dict, path: jax.Array, speed: jax.Array, p: jax.Array
    ) -> jax.Array:
        """Mean stage cost of the window."""
        weights, parameters = (
            split(flat),
            dict(zip(self._stepper.layout.parameters, p.T, strict=True)),
        )
        stack = lambda values: jnp.stack(jnp.broadcast_arrays(*values))  # noqa: E731

        def period(carry: dict, _: None) -> tuple[dict, jax.Array]:
            place, sensed = self._sense(carry, path, speed)
            h = stack(sensed["inputs"])
            for W, b in weights[:-1]:
                h = jax.nn.relu(W @ h + b[:, None])
            raw = weights[-1][0] @ h + weights[-1][1][:, None]
            rows = (list(carry["control"]), list(carry["last"]), list(raw))
            acted = act(sensed["errors"], *rows, COST, self._law, XP)

            def physics(moving: tuple, _: None) -> tuple[tuple, jax.Array]:
                actuator, command = drive(
                    list(moving[1]), acted["last"][SIZES["gains"] :], self._law, XP
                )
                plant = self._physics(moving[0], stack(command), parameters)
                return (plant, stack(actuator)), stack(self._motion(plant))

            start = (carry["plant"], carry["actuator"])
            (plant, actuator), motions = jax.lax.scan(physics, start, length=PHYSICS_STEPS)
            after = {
                "plant": plant,
                "before": motions[-2],
                "progress": place[0],
                "captured": place[1],
            }
            after |= {
                k: stack(v)
                for k, v in (("guidance", sensed["guidance"]), ("control", acted["control"]))
            }
            after |= {"actuator": actuator, "last": stack(acted["last"])}
            return after, sensed["cost"][0].sum() * carry["counts"] + acted["cost"][0].sum()

        def counted(carry: dict, _: None) -> tuple[dict, jax.Array]:
            after, cost = period(carry, None)
            return {**after, "counts": jnp.ones(())}, cost

        carry, costs = jax.lax.scan(counted, {**carry, "counts": jnp.zeros(())}, None, length=STEPS)
        _, sensed = self._sense(carry, path, speed)
        return (costs.sum() + sensed["cost"][0].sum()) / (len(speed) * STEPS)


def make_batch(
    stepper: Stepper, bank: PathBank, batch: int, rng: np.random.Generator
) -> BatchState:
    """Fish near the start of their paths, swimming at 0.2 m/s."""
    path = np.arange(batch) % len(bank)
    poses = np.array([[*bank.paths[k].point(0.0), bank.paths[k].heading_at(0.0)] for k in path])
    poses += rng.normal(0.0, [0.02, 0.05, 0.1], (batch, 3))
    plant = np.array([stepper.rest(tuple(pose)) for pose in poses])
    size = stepper.layout.links + 3
    plant[:, size : size + 2] = 0.2 * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    seen = np.column_stack([poses, np.full(batch, 0.2), np.zeros((batch, 2))])
    return BatchState.at(
        plant, stepper.parameters(Robot()), path, rng.uniform(0.1, 0.3, batch), seen
    )


def carry_of(batch_state: BatchState) -> dict:
    """The batch's state as JaxLoop carries it: rows are quantities, columns fish."""
    cuts = np.cumsum([SIZES[k] for k in ("guidance", "control", "actuator")])
    parts = dict(
        zip(
            ("guidance", "control", "actuator", "last"),
            np.split(batch_state.memory.T, cuts),
            strict=True,
        )
    )
    carry = {
        "plant": batch_state.plant.T,
        "before": batch_state.history[:, -1].T,
        **parts,
        "progress": batch_state.place[:, 0],
    }
    return {k: jnp.array(v) for k, v in carry.items()} | {
        "captured": jnp.array(batch_state.place[:, 1] != 0.0)
    }


def seconds(call, budget: float) -> float:
    """Shortest time of a call in `budget` seconds: what other programs do to the machine is not measured."""
    times: list[float] = []
    while sum(times) < budget or len(times) < 5:
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    """Compare at the batch sizes of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--batch", type=int, nargs="+", default=[8, 64])
    parser.add_argument("--seconds", type=float, default=5.0)
    args = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    law, stepper = Law(), Stepper(Robot().structure, Scheme("rk4", 1))
    bank = PathBank(
        [make_path("circle", radius=1.0), make_path("sinusoid", amplitude=1.0, length=10.0)],
        law.tracker,
    )
    rng = np.random.default_rng(0)
    start = {
        "steering_kp": 0.5,
        "steering_ki": 0.1,
        "steering_kd": 0.1,
        "speed_kp": 1.0,
        "speed_ki": 0.05,
        "speed_kd": 0.01,
    }
    weights = initial_weights(rng, start) + 0.02 * rng.standard_normal(
        len(initial_weights(rng, start))
    )
    ours, theirs = CompiledLoop(stepper, law, bank), JaxLoop(stepper, law, bank)
    for batch in args.batch:
        batch_state = make_batch(stepper, bank, batch, rng)
        for _ in range(3):
            ours.window(weights, batch_state, STEPS, COST)
        inputs = (
            jnp.array(weights),
            carry_of(batch_state),
            *map(jnp.array, (batch_state.path, batch_state.speed, batch_state.parameters)),
        )
        began = time.perf_counter()
        value, gradient = jax.block_until_ready(theirs.gradient(*inputs))
        compiled_in = time.perf_counter() - began
        mine = ours.window(weights, batch_state.copy(), STEPS, COST)
        apart = np.abs(np.asarray(gradient) - mine.gradient).max() / np.abs(mine.gradient).max()
        scratch = batch_state.copy()

        def kernel(scratch: BatchState = scratch, batch_state: BatchState = batch_state) -> None:
            for name, value in vars(batch_state).items():
                getattr(scratch, name)[...] = value
            ours.window(weights, scratch, STEPS, COST)

        a = seconds(kernel, args.seconds)
        b = seconds(
            lambda inputs=inputs: jax.block_until_ready(theirs.gradient(*inputs)), args.seconds
        )
        rate = batch * STEPS
        print(
            f"B = {batch:3d}: compiled {rate / a:9.0f} env steps/s, JAX {rate / b:9.0f}, ratio {b / a:.2f} "
            f"(cost {mine.cost:.9f} / {float(value):.9f}, gradients {apart:.1e} apart, "
            f"JAX compiled in {compiled_in:.0f} s)"
        )


if __name__ == "__main__":
    main()
