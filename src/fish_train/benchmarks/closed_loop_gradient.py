# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gradient of a training window: compiled kernel against jitted JAX, same equations, same numbers, one core.

    taskset -c 0 python src/fish_train/benchmarks/closed_loop_gradient.py

Needs jax and jaxlib (pip install jax jaxlib), which nothing else in the project uses. The laws and the cost are
the project's own functions traced with jax.numpy; the physics is that of `jax_fish`; periods, physics steps and stages run in
lax.scan. Prints environment steps (of 20 ms, two physics steps) per second, forward and backward,
and how far both gradients are apart.
"""

from __future__ import annotations

import argparse
import os
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import jax
import jax.numpy as jnp
import numpy as np
from jax_loop import JaxLoop

from fish_control.paths import make_path
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.step import Stepper
from fish_train.training.batch import BatchState, PathBank
from fish_train.training.closed_loop_equations import (
    SIZES,
    Law,
)
from fish_train.training.compiled_loop import CompiledLoop
from fish_train.training.network import initial_weights

STEPS = 15
COST = np.array([1.0, 10.0, 10.0, 0.1, 0.01, 0.1])


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
    ours, theirs = CompiledLoop(stepper, law, bank), JaxLoop(stepper, law, bank, STEPS, COST)
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
