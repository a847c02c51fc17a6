# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Poses of many windows simulated at once, by a quick stepper, with slopes along parameters and start states.

A likelihood needs the tail's mode to a part in a million, a prediction of stroke means does not: RK4 with as many steps in a
period as the robot's own modes need takes less than half of the time.

Slopes are forward differences: one more lane of the value kernel per direction. Of a tail of one link a lane of values costs
0.26 us a step and a lane of tangents 1.06 us, and the value kernel is compiled in a fraction of the time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import cores, on_all_cores
from fish_sim.robot import nominal_parameters
from fish_sim.scheme import Scheme, stable_scheme
from fish_sim.step import Stepper
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import KNOWLEDGE_PRIOR, Hypothesis, Parametrization
from fish_sysid.estimation.shooting.residuals import Windows

Array = NDArray[np.float64]

QUICK = Scheme("rk4", 1)
UNSTATED = "unknown"
ROUNDING = 1e-9  # of a logarithm and back: keeps a value at an end of its range inside it
STEP = 1e-5  # of theta and of the start states, for forward differences


class ShotParametrization(Parametrization):
    """`Parametrization` of a hypothesis whose robot is near theta."""

    def __init__(self, hypothesis: Hypothesis, theta: Array | None = None) -> None:
        super().__init__(hypothesis)
        known = hypothesis.robot.knowledge
        sigma = [KNOWLEDGE_PRIOR[known.get(name, UNSTATED)] for name in hypothesis.free]
        self.prior = np.where(self.is_log, sigma, self.prior)
        table = nominal_parameters(hypothesis.robot.links)
        for i, name in enumerate(hypothesis.free):
            if name in table:
                self.lowest[i] = max(self.lowest[i], table[name].lowest * (1.0 + ROUNDING))
                self.highest[i] = min(self.highest[i], table[name].highest * (1.0 - ROUNDING))
        self.stepper = quick_stepper(self, self.origin() if theta is None else theta)


def quick_stepper(coordinates: Parametrization, theta: Array) -> Stepper:
    """A stepper with the fewest steps of RK4 that are stable at theta (K,)."""
    robot = coordinates.robot(theta)
    return Stepper(robot.structure, stable_scheme(robot, QUICK))


def states(stepper: Stepper, experiment: Experiment, windows: Windows, p: Array, x: Array) -> Array:
    """(steps + 1, W, NS) states from start motions x (W, NX), with parameters p (NP,) and the commands before the windows."""
    memory = memories(stepper, experiment, windows, p[None])[0]
    return stepper.rollout(np.concatenate([x, memory], axis=1), windows.commands, p)


def memories(stepper: Stepper, experiment: Experiment, windows: Windows, p: Array) -> Array:
    """(L, W, NM) memory of servo, motor and actuator effects at the windows' starts, with parameters p (L, NP)."""
    out = np.empty((len(p), len(windows), len(stepper.layout.memory)))
    for m in np.unique(windows.trial).tolist():
        own = np.flatnonzero(windows.trial == m)
        last = int(windows.start[own].max())
        still = np.zeros_like(p)
        first, _ = stepper.settled_memory(
            np.repeat(experiment.commands[:1, m], len(p), axis=0), p, still
        )
        told = np.repeat(experiment.commands[: last + 1, m][:, None], len(p), axis=1)
        memory, _ = stepper.memory_jvp(first, told, p, still)
        out[:, own] = memory[windows.start[own]].transpose(1, 0, 2)
    return out


def poses_and_slopes(
    stepper: Stepper, experiment: Experiment, windows: Windows, p: Array, dp: Array, x: Array
) -> tuple[Array, Array]:
    """Poses (steps + 1, W, 3) and slopes (steps + 1, W, 3, K + NX) along theta and the start motions x (W, NX).

    p (NP,): parameters; dp (K, NP): their slopes with respect to theta.
    """
    K, nx = len(dp), x.shape[1]
    C = 1 + K + nx
    p = np.concatenate([p[None], p + STEP * dp])
    memory = memories(stepper, experiment, windows, p)
    start = np.repeat(np.concatenate([x, memory[0]], axis=1)[:, None], C, axis=1)
    start[:, 1 : 1 + K, nx:] = memory[1:].transpose(1, 0, 2)
    start[:, 1 + K + np.arange(nx), np.arange(nx)] += STEP
    p = np.concatenate([p, np.repeat(p[:1], nx, axis=0)])

    def share(own: NDArray[np.int64]) -> tuple[Array, Array]:
        told = np.repeat(windows.commands[:, own], C, axis=1)
        states = stepper.rollout(
            start[own].reshape(len(own) * C, -1), told, np.tile(p, (len(own), 1))
        )
        pose = states[..., :3].reshape(len(states), len(own), C, 3)
        slope = (pose[:, :, 1:] - pose[:, :, :1]) / STEP
        return np.ascontiguousarray(pose[:, :, 0]), np.ascontiguousarray(
            slope.transpose(0, 1, 3, 2)
        )

    parts = on_all_cores(
        share, np.array_split(np.arange(len(windows)), max(1, min(2 * cores(), len(windows))))
    )
    pose, slope = zip(*parts, strict=True)
    return np.concatenate(pose, axis=1), np.concatenate(slope, axis=1)
