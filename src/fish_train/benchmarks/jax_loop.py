# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A training window in JAX: the project's laws and cost traced with jax.numpy around the fish of `jax_fish`."""

from __future__ import annotations

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
from jax_fish import COORDINATES, motion_rates
from numpy.typing import NDArray

from fish_control.path_batch import LOOKAHEAD_SEARCH
from fish_sim.model import DT
from fish_sim.step import Stepper
from fish_train.training.batch import PathBank
from fish_train.training.closed_loop_equations import (
    PHYSICS_STEPS,
    SIZES,
    Law,
    act,
    drive,
    motion,
    sense,
)
from fish_train.training.network import split

Array = NDArray[np.float64]

RK4 = np.array(
    [[0.0, 1 / 6, 0.0], [0.5, 1 / 3, 0.5], [0.5, 1 / 3, 0.5], [1.0, 1 / 6, 1.0]]
)  # a, b, c of each stage
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


class JaxLoop:
    """The window's cost and gradient under jax.jit; perfect state, open or endless paths as in this benchmark."""

    def __init__(self, stepper: Stepper, law: Law, bank: PathBank, steps: int, cost: Array) -> None:
        self._stepper, self._law, self._steps, self._weights = stepper, law, steps, cost
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
            self._weights,
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
            acted = act(sensed["errors"], *rows, self._weights, self._law, XP)

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

        carry, costs = jax.lax.scan(
            counted, {**carry, "counts": jnp.zeros(())}, None, length=self._steps
        )
        _, sensed = self._sense(carry, path, speed)
        return (costs.sum() + sensed["cost"][0].sum()) / (len(speed) * self._steps)
