# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""IMU readings moved to the moment that they were taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment, Headings

Array = NDArray[np.float64]


def imu_moved_back(experiment: Experiment, delay: float) -> Experiment:
    """The experiment with gyro and accelerometer `delay` [s] earlier, to the nearest grid point, and orientation exactly."""
    if delay == 0.0:
        return experiment
    steps = round(delay / DT)
    headings = tuple(Headings(h.t - delay, h.psi) for h in experiment.headings)
    return replace(
        experiment,
        gyro=_earlier(experiment.gyro, steps),
        accel=_earlier(experiment.accel, steps),
        headings=headings,
    )


def _earlier(values: Array, steps: int) -> Array:
    """Values (T, ...) a number of grid points earlier; NaN where none are left."""
    out = np.full_like(values, np.nan)
    kept = max(len(values) - abs(steps), 0)
    if steps >= 0:
        out[:kept] = values[len(values) - kept :]
    else:
        out[len(values) - kept :] = values[:kept]
    return out
