# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Initial noise estimate, chosen by likelihood before fitting, so that the EKF does not diverge on a wrong model."""

from __future__ import annotations

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate, likelihoods
from fish_sysid.estimation.noise_estimation import NOISE_MOVES, SENSOR_MOVES, estimate_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.thresholds import INITIAL_WRENCH_LADDER, INNOVATION_RMS_REJECT


def initial_noise(experiment: Experiment, robot: Robot, noise: Noise) -> Noise:
    """The wrench noise of INITIAL_WRENCH_LADDER with the highest likelihood; sensor noise too where `noise` is too small."""
    hypothesis, theta = nominal_hypothesis(robot, free=()), np.zeros(0)
    scaled = [noise.ungated().with_wrench(factor) for factor in INITIAL_WRENCH_LADDER]
    best = scaled[int(np.argmax(likelihoods(hypothesis, theta, experiment, scaled)))]
    fit = evaluate(hypothesis, theta, experiment, best)
    if fit.max_innovation_rms < INNOVATION_RMS_REJECT and best is not scaled[-1]:
        return best
    return estimate_noise(fit, experiment, 2, (*SENSOR_MOVES, *NOISE_MOVES))
