# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Forward steps per second on one core against MuJoCo's C engine with the same number of joints.

    taskset -c 0 python src/fish_sim/benchmarks/forward_speed.py

Needs mujoco (requirements-bench.txt). Peers, stepped in C without
Python in between: a head free in the plane and three hinged links with springs, the same six joints. "fish" is
the fair one: it computes fluid forces (MuJoCo's ellipsoid model), as the fish does, and has MuJoCo's default
options; "bare" has contacts, constraints and water switched off and computes less than the fish. Neither has a
no-slip tip or a rotor. MuJoCo and RK4 advance 10 ms in one step, the default scheme in two. All cases are measured
in turns, in processor time; the best of each counts. The fish's rollouts write every state, MuJoCo writes none.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from fish_sim.robot import Robot
from fish_sim.scheme import Scheme, default_scheme
from fish_sim.step import Stepper

ROUNDS = 5
STEPS = 100_000  # of one fish in a measurement; long enough that the states lie in large pages
BATCHES = (1, 64, 256)
LINK = (
    '<body pos="{x} 0 0"><joint axis="0 0 1" stiffness="0.01" damping="{damping}"/>'
    '<geom type="ellipsoid" pos="-0.012 0 0" size="0.012 0.002 0.0375" mass="0.12" {geom}/>'
)
MODEL = """
<mujoco>
  <option timestep="0.01" gravity="0 0 0" integrator="{integrator}" jacobian="dense" {water}>
    {flags}
  </option>
  <worldbody>
    <body>
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint name="head" axis="0 0 1"/>
      <geom type="ellipsoid" size="0.075 0.03 0.0375" mass="0.465" {geom}/>{tail}
    </body>
  </worldbody>
  <actuator><motor joint="head"/></actuator>
</mujoco>
"""
PEERS = {
    "bare": {
        "water": "",
        "geom": "",
        "damping": 0,
        "flags": '<flag contact="disable" constraint="disable"/>',
    },
    "fish": {
        "water": 'density="1000" viscosity="0.001"',
        "geom": 'fluidshape="ellipsoid" contype="0" conaffinity="0"',
        "damping": 1e-4,
        "flags": "",
    },
}


def peer(integrator: str, kind: str) -> Callable[[], float]:
    """Steps per second of MuJoCo with this integrator and one of PEERS."""
    import mujoco

    options = PEERS[kind]
    tail = "".join(LINK.format(x=x, **options) for x in (-0.075, -0.0233, -0.0233)) + "</body>" * 3
    model = mujoco.MjModel.from_xml_string(
        MODEL.format(integrator=integrator, tail=tail, **options)
    )
    data = mujoco.MjData(model)
    if model.nv != 6:
        raise RuntimeError(f"the peer has {model.nv} degrees of freedom, the fish has 6")

    def run() -> float:
        mujoco.mj_resetData(model, data)
        data.qvel[:] = 0.1
        start = time.thread_time()
        mujoco.mj_step(model, data, STEPS)
        seconds = time.thread_time() - start
        if data.warning.number.any() or not np.isfinite(data.qpos).all():
            raise RuntimeError(
                f"the peer ({kind}, {integrator}) became unstable; its speed means nothing"
            )
        return STEPS / seconds

    return run


def ours(scheme: Scheme, batch: int) -> Callable[[], float]:
    """Fish steps per second of the compiled kernel at this batch size."""
    robot = Robot()
    stepper = Stepper(robot.structure, scheme)
    start, parameters = np.tile(stepper.rest(), (batch, 1)), stepper.parameters(robot)
    steps = max(1, STEPS // batch)
    time_s = 0.01 * np.arange(steps)
    commands = np.stack([113.0 * np.sin(4 * np.pi * time_s), 0.3 * np.sin(time_s)], axis=-1)
    stepper.rollout(start, commands[:2], parameters)

    def run() -> float:
        begin = time.thread_time()
        stepper.rollout(start, commands, parameters)
        return batch * steps / (time.thread_time() - begin)

    return run


def node_step_us() -> float:
    """Microseconds of one step at batch 1 as the simulator node calls it."""
    robot = Robot()
    stepper = Stepper.of(robot)
    state, parameters, command = stepper.rest(), stepper.parameters(robot), np.zeros(2)
    best = np.inf
    for _ in range(ROUNDS):
        begin = time.thread_time()
        for _ in range(2000):
            state = stepper.step(state, command, parameters)
        best = min(best, (time.thread_time() - begin) / 2000)
    return 1e6 * best


def main() -> int:
    try:
        peers = {(i, kind): peer(i, kind) for kind in PEERS for i in ("Euler", "RK4")}
    except ImportError:
        print(
            "forward_speed: mujoco is not installed (pip install mujoco): no ratio", file=sys.stderr
        )
        return 2
    schemes = {"rk4": Scheme("rk4"), "default": default_scheme(3)}
    cases = {(n, b): ours(scheme, b) for n, scheme in schemes.items() for b in BATCHES}
    best: dict[object, float] = {}
    for _ in range(ROUNDS):
        for key, run in (*peers.items(), *cases.items()):
            best[key] = max(best.get(key, 0.0), run())
    print(" " * 42 + "times as fast as MuJoCo")
    print(" " * 40 + "".join(f"{kind + ' ' + integrator:>14}" for integrator, kind in peers))
    print(f"{'MuJoCo, steps/s':40}" + "".join(f"{best[p]:14,.0f}" for p in peers))
    for name, batch in cases:
        rate = best[name, batch]
        ratios = "".join(f"{rate / best[p]:14.1f}" for p in peers)
        print(f"fish_sim {name:7} batch {batch:3d} {rate:12,.0f}/s {ratios}")
    print(f"one step from Python at batch 1 (default): {node_step_us():.1f} us")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
