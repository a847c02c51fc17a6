# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state at a moment from the second before it: a window that ends there, its start motion by least squares.

Where a model is wrong a filter's gains are those of a force that the water never has. Shooting over a short past takes the
model's errors of that time only, and the IMU's orientation as the heading it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.camera import moved_back
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.estimation.parametrization import nominal_hypothesis, sensor_model
from fish_sysid.estimation.shooting.multiple_shooting import Shooting
from fish_sysid.estimation.shooting.residuals import SENSORS, Scale, cut
from fish_sysid.estimation.shooting.rollout import ShotParametrization, states

Array = NDArray[np.float64]

PAST = 1.0  # s
ITERATIONS = 6
# the camera's usual noise; an IMU's heading drifts by as much within the past; an error of a wrong model lasts half a second.
# A fit finds its own (`trust`)
START_TRUST = Scale(position=0.002, heading=0.012, orientation=0.012, fading=0.5)


def without_sensor_errors(experiment: Experiment, robot: Robot) -> Experiment:
    """The experiment with its images as they would be without the robot's latency, heading offset and scale of the camera."""
    sensors = sensor_model(robot)
    moved = moved_back(experiment, sensors.camera_latency)
    shown = np.array([sensors.camera_scale, sensors.camera_scale, 1.0])
    offset = np.array([0.0, 0.0, sensors.camera_heading_offset])
    return replace(
        moved, frames=tuple(Frames(f.t, (f.pose - offset) / shown) for f in moved.frames)
    )


def shot_states(
    experiment: Experiment,
    robot: Robot,
    starts: NDArray[np.int64],
    sensors: Array | None = None,
    past: float = PAST,
    trust: Scale = START_TRUST,
    ahead: float = 0.0,
) -> Array:
    """(S, NS) states at starts (S, 2) of trial and grid point by what was measured in the `past` [s] before each.

    trust: how far which sensor and an old sample are trusted.
    ahead: s after each start whose measurements may be known too; sensors: (4,) in units of SENSOR_SCALE. NaN where the camera
    hardly saw the fish or the motion diverged.
    """
    coordinates = ShotParametrization(nominal_hypothesis(robot, free=()))
    stepper, steps = coordinates.stepper, round(past / DT)
    out = np.full((len(starts), len(stepper.layout.state)), np.nan)
    early = (starts - [0, steps]).astype(np.int64)
    possible = np.flatnonzero(early[:, 1] >= 0)
    windows = cut(experiment, early[possible], past + ahead, late=0.0)
    if not len(windows):
        return out
    shooting = Shooting(experiment, coordinates, windows, trust)
    sensors = np.zeros(len(SENSORS)) if sensors is None else sensors
    guess = shooting.settle(shooting.first_guess(np.zeros(0), sensors), ITERATIONS)
    p = coordinates.filter_inputs(np.zeros(0))[0]
    end = states(stepper, experiment, windows, p, guess.x)[steps]
    place = {row: i for i, row in enumerate(map(tuple, starts.tolist()))}
    ends = np.column_stack([windows.trial, windows.start + steps]).tolist()
    out[[place[tuple(row)] for row in ends]] = end
    return out
