# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which way to the state at a start point predicts better: the filter, or shooting over the past second."""

from __future__ import annotations

import numpy as np

from fish_sim.robot import Robot
from fish_sim.robot_file import STATES
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.shooting.residuals import Scale
from fish_sysid.prediction.kept_noise import with_noise
from fish_sysid.prediction.prediction import EVERY, HORIZONS, WARM_UP, predict, prediction_errors


def better_states(training: Experiment, robot: Robot, noise: Noise, trust: Scale) -> str:
    """The way to start states, shooting or filter, with the smaller errors of predictions on training trials."""
    return min(
        STATES,
        key=lambda way: prediction_size(training, with_noise(robot, noise, way, trust), noise),
    )


def prediction_size(training: Experiment, robot: Robot, noise: Noise) -> float:
    """Sum of the logarithms of a robot's prediction errors: position, heading and speed at all horizons."""
    made = predict(training, robot, noise, max(HORIZONS), EVERY, WARM_UP)
    return float(np.nansum(np.log(prediction_errors(made).rms)))
