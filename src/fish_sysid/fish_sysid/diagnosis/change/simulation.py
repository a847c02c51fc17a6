# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Channels of a simulated robot under the recorded commands: what an effect or a parameter would change.

The fish starts at rest; what a wrong start does is gone after the first second and a half, which no stroke mean covers. A
simulation that diverges, as one of a rotor that jumps may, starts again from rest there; the channels around it are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.grid import in_base_link
from fish_sysid.diagnosis.change.channels import (
    AT_CENTRES,
    HALF_WIDTH,
    MEANS,
    StrokeWeights,
    Swim,
    parts,
)
from fish_sysid.estimation.ekf import filter_stepper
from fish_sysid.prediction.stroke_average import stroke_mean

Array = NDArray[np.float64]

# m/s or rad/s, and SI units; what exceeds it has diverged
LARGEST_MEAN, LARGEST_AMPLITUDE = 2.0, 20.0
LANES = 240  # trials times variants of one pass: memory
MOST_RESTARTS = 10  # of one trial
BEFORE, AFTER = 0.3, 1.5  # s around a restart, in which the states say nothing


@dataclass(frozen=True)
class Variant:
    """A robot with an effect, or with other parameters of its own."""

    effect: str  # "": none
    values: Mapping[str, float]  # of all parameters of the effect, or of the robot


def simulate(
    robot: Robot, experiment: Experiment, days: Sequence[Swim], variants: Sequence[Variant]
) -> list[list[Array]]:
    """Channels (C, 12) of every variant in each of these trials, NaN near a restart; the camera and the gyro agree in them.

    Variants of one effect share a compiled kernel and are simulated side by side.
    """
    trials = [experiment.names.index(swim.name) for swim in days]
    lenses = [
        _Lens.of(swim, experiment.commands[: experiment.steps[m], m, 0])
        for m, swim in zip(trials, days, strict=True)
    ]
    at_once = max(1, LANES // len(trials))
    found: dict[int, list[Array]] = {}
    for effect in dict.fromkeys(v.effect for v in variants):
        which = [i for i, v in enumerate(variants) if v.effect == effect]
        for first in range(0, len(which), at_once):
            some = which[first : first + at_once]
            made = _pass(robot, experiment, lenses, trials, [variants[i] for i in some])
            found.update(zip(some, made, strict=True))
    return [found[i] for i in range(len(variants))]


def _pass(
    robot: Robot,
    experiment: Experiment,
    lenses: Sequence[_Lens],
    trials: list[int],
    variants: Sequence[Variant],
) -> list[list[Array]]:
    robots = [_robot(robot, variant) for variant in variants]
    stepper, M = filter_stepper(robots[0]), len(trials)
    table = np.array([stepper.parameters(r) for r in robots])
    commands = np.tile(experiment.commands[:, trials], (1, len(variants), 1))
    x, lost = rollout(stepper, np.repeat(table, M, axis=0), commands)
    turn = stepper.layout.links + 3
    return [
        [
            lens.channels(x[: experiment.steps[m] + 1, i * M + j], lost[:, i * M + j], turn)
            for j, (m, lens) in enumerate(zip(trials, lenses, strict=True))
        ]
        for i in range(len(variants))
    ]


def rollout(stepper: Stepper, table: Array, commands: Array) -> tuple[Array, Array]:
    """States (T + 1, B, NS) of fish that start at rest, and where they say nothing (T + 1, B) after a restart from rest.

    Nothing is said either of what MOST_RESTARTS leave diverged, from the first window of an amplitude on that reaches it.
    table (B, P): their parameters; commands (T, B, 2).
    """
    rest = np.array([stepper.rest((0.0, 0.0, 0.0), parameters=row) for row in table])
    x = stepper.rollout(rest, commands, table)
    lost = np.zeros(x.shape[:2], dtype=bool)
    before, after = round(BEFORE / DT), round(AFTER / DT)
    for _ in range(MOST_RESTARTS):
        gone: NDArray[np.bool_] = np.asarray(~np.isfinite(x[:-1]).all(axis=2))
        for lane in np.flatnonzero(gone.any(axis=0)):
            k = int(gone[:, lane].argmax())
            lost[max(k - before, 0) : k + after, lane] = True
            again = stepper.rollout(rest[[lane]], commands[k:, [lane]], table[[lane]])
            x[k:, lane] = again[:, 0]
        if not gone.any():
            return x, lost
    left: NDArray[np.bool_] = np.asarray(~np.isfinite(x[:-1]).all(axis=2))
    for lane in np.flatnonzero(left.any(axis=0)):
        lost[max(int(left[:, lane].argmax()) - round(HALF_WIDTH / DT), 0) :, lane] = True
    return x, lost


def _robot(robot: Robot, variant: Variant) -> Robot:
    if not variant.effect:
        return robot.with_parameters(**variant.values)
    return robot.with_effect(variant.effect, **variant.values)


@dataclass(frozen=True)
class _Lens:
    """What turns the states of a trial into channels."""

    value: csr_matrix  # (C, T), of the stroke mean
    slope: csr_matrix  # (C, T) 1/s
    strokes: StrokeWeights

    @classmethod
    def of(cls, swim: Swim, rotor: Array) -> _Lens:
        weights = stroke_mean(DT * np.arange(len(rotor), dtype=np.float64), swim.means.t)
        value, slope = (csr_matrix(np.nan_to_num(w)) for w in (weights.value, weights.slope))
        return cls(value, slope, StrokeWeights.of(rotor, swim.means.t))

    def channels(self, x: Array, lost: Array, turn: int) -> Array:
        """(C, 12) of states (T + 1, NS); `turn`: where the velocities begin; NaN at centres whose window has lost ones (T,)."""
        pose, velocity = x[:-1, :3], x[:, turn : turn + 2]
        mean, rate = self.value @ pose, self.slope @ pose
        surge, sway = in_base_link(rate[:, 0], rate[:, 1], mean[:, 2])
        push = np.diff(velocity, axis=0) / DT
        ahead, left = in_base_link(push[:, 0], push[:, 1], pose[:, 2])
        H = parts(self.strokes.amplitudes(x[:-1, turn + 2], ahead, left))
        out = np.zeros((len(mean), AT_CENTRES))
        motion = np.column_stack([surge, sway, rate[:, 2]])
        out[:, : MEANS - 1] = np.clip(np.nan_to_num(motion), -LARGEST_MEAN, LARGEST_MEAN)
        out[:, MEANS:] = np.clip(np.nan_to_num(H), -LARGEST_AMPLITUDE, LARGEST_AMPLITUDE)
        out[abs(self.value) @ lost[: len(x) - 1] > 0.0] = np.nan
        return out
