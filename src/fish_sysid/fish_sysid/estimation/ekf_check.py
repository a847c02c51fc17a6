# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled filter against the NumPy one on a few invented samples, in place of trust in the compiler."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fish_sim.model import DT
from fish_sim.robot import Structure
from fish_sim.scheme import Scheme, default_scheme
from fish_sim.self_check import random_parameters, relative_error
from fish_sim.step import Stepper
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.estimation.ekf_numpy import Filter
from fish_sysid.estimation.ekf_types import (
    Array,
    FilterResult,
    Noise,
    Problem,
    SensorModel,
)

STEPS = 5  # grid points: three with a camera pose, four with an IMU sample
SEED = 2
SENSORS = (
    "camera_latency",
    "camera_heading_offset",
    "camera_scale",
    "gyro_scale",
    "imu_misalignment",
)
# what is compared; the history's members by their own names
SUMS = ("log_likelihood", "samples", "gradient", "normal", "whitened")
MOMENTS = ("predicted", "predicted_P", "filtered", "filtered_P", "transition")

# with the problem, the noise and the memory of a NumPy filter
Pass = Callable[[Filter], FilterResult]


def filter_errors(structure: Structure, method: str, width: int, run: Pass) -> dict[str, float]:
    """Largest relative error of every result of a compiled pass, `run`; more free parameters than a vector holds."""
    reference = Filter(sample_problem(structure, method, width + 1), Noise())
    right, found = reference.run(keep=True), run(reference)
    pairs = {name: (getattr(found, name), getattr(right, name)) for name in SUMS}
    assert found.history is not None
    assert right.history is not None
    # after the last grid point there is no transition
    pairs |= {
        name: (getattr(found.history, name)[:-1], getattr(right.history, name)[:-1])
        for name in MOMENTS
    }
    return {name: _error(*pair) for name, pair in pairs.items()}


def sample_problem(structure: Structure, method: str, free: int) -> Problem:
    """One trial of a swimming fish, seen by every sensor, with `free` free parameters, the sensors' own among the first."""
    random = np.random.default_rng(SEED)
    scheme = Scheme(method, default_scheme(structure[0]).substeps)
    stepper = Stepper(structure, scheme, compiled=False)
    p = random_parameters(stepper.layout, 1, random)[0]
    dp = p * random.normal(size=(free, len(p)))
    sensors = SensorModel(
        0.004,
        0.1,
        1.02,
        0.97,
        0.05,
        {name: k % free for k, name in enumerate(SENSORS)},
        {"gyro_scale": 1.1},
    )
    return Problem(_experiment(random), stepper, p, dp, sensors)


def _experiment(random: np.random.Generator) -> Experiment:
    commands = random.uniform(-1.0, 1.0, (STEPS, 1, 2)) * [60.0, 0.3]
    gyro, accel = random.uniform(-0.1, 0.1, (STEPS, 1)), random.uniform(-0.2, 0.2, (STEPS, 1, 2))
    gyro[1] = np.nan
    t = DT * np.array([0.0, 2.1, 3.0])
    pose = np.array([0.3, 0.2, 0.5]) + random.uniform(-0.01, 0.01, (len(t), 3))
    encoder = np.full((STEPS, 1), np.nan)  # is read outside of the compiled text
    return Experiment(
        ("check",), np.array([STEPS]), commands, gyro, accel, encoder, (Frames(t, pose),), False
    )


def _error(found: Array, right: Array) -> float:
    """Of all components together: those of a covariance differ by the units' squares, and of one that is 0 by nothing."""
    said = np.isfinite(right)
    if not said.any() or not np.array_equal(said, np.isfinite(found)):
        return np.inf
    return relative_error(found[said][:, None], right[said][:, None])
