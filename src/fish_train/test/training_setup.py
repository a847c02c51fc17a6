# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A small batch, bank and network shared by the tests of training."""

import numpy as np

from fish_control.paths import make_path
from fish_sim.robot import Robot
from fish_sim.step import Scheme, Stepper
from fish_train.training.batch_state import BatchState
from fish_train.training.closed_loop_equations import Law
from fish_train.training.network import FORMS, initial_weights
from fish_train.training.path_bank import PathBank

START = {
    "steering_kp": 0.5,
    "steering_ki": 0.2,
    "steering_kd": 0.05,
    "speed_kp": 0.6,
    "speed_ki": 0.03,
    "speed_kd": 0.01,
}
COST = np.array([1.0, 10.0, 20.0, 2.0, 0.01, 0.2])


def make_stepper(compiled: bool = True) -> Stepper:
    """The integration of training."""
    return Stepper(Robot().structure, Scheme("rk4", 1), compiled)


def make_bank(law: Law) -> PathBank:
    """A closed and an open path."""
    paths = [make_path("circle", radius=0.8), make_path("sinusoid", amplitude=0.5, length=3.4)]
    return PathBank(paths, law.tracker)


def make_weights(form: str, rng: np.random.Generator) -> np.ndarray:
    """A network that is neither constant nor saturated."""
    weights = initial_weights(rng, START, FORMS[form].layers)
    return weights + 0.02 * rng.standard_normal(weights.shape)


def make_batch(
    stepper: Stepper, bank: PathBank, batch: int, rng: np.random.Generator
) -> BatchState:
    """Fish beside the starts of their paths, swimming at 0.15 m/s."""
    path = np.arange(batch) % len(bank)
    poses = np.array([[*bank.paths[k].point(0.3), bank.paths[k].heading_at(0.3)] for k in path])
    poses += rng.normal(0.0, [0.02, 0.02, 0.1], (batch, 3))
    plant = np.array([stepper.rest(tuple(pose)) for pose in poses])
    size = stepper.layout.links + 3
    plant[:, size : size + 2] = 0.15 * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    seen = np.column_stack([poses, np.full(batch, 0.15), np.zeros((batch, 2))])
    batch_state = BatchState.at(
        plant, stepper.parameters(Robot()), path, rng.uniform(0.1, 0.3, batch), seen
    )
    batch_state.place[:, [0, 2]] = 0.3
    return batch_state
