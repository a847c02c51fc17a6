"""Noise that suits a model and its recordings before anything is fitted: a filter that trusts a wrong model gets lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate, likelihoods
from fish_sysid.estimation.noise_estimation import NOISE_MOVES, SENSOR_MOVES, adapt_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis

OPEN = 1e9  # gates: nothing is left out
LADDER = (1.0, 4.0, 16.0, 64.0)  # of the wrench's standard deviations
STRANGE = (
    4.0  # rms of whitened innovations that no wrench explains: the sensors are noisier than said
)
SENSOR_ROWS = slice(
    0, 6
)  # of the whitened innovations: all but the encoder's, which no free number moves


def open_gates(noise: Noise) -> Noise:
    """The same noise without gates: a filter that leaves out what surprises it can lose the fish for good."""
    return replace(noise, gate_camera=OPEN, gate_imu=OPEN)


def worst_row(fit: Fit) -> float:
    """Largest rms of whitened innovations over IMU and camera: 1 when the noise is right, inf when it diverged."""
    rows = fit.result.whitened[..., SENSOR_ROWS]
    count = np.isfinite(rows).sum(axis=(0, 1))
    if not np.isfinite(fit.objective):
        return float("inf")
    return float(np.sqrt(np.max(np.nansum(rows**2, axis=(0, 1)) / np.maximum(count, 1))))


def suitable_noise(experiment: Experiment, robot: Robot, noise: Noise) -> Noise:
    """The wrench noise of LADDER with the highest likelihood; sensor noise too when the sensors are noisier than `noise`."""
    fit = evaluate(nominal_hypothesis(robot, free=()), np.zeros(0), experiment, open_gates(noise))
    x, y, n = noise.wrench
    scaled = [replace(fit.noise, wrench=(f * x, f * y, f * n)) for f in LADDER]
    best = scaled[int(np.argmax(likelihoods(fit.hypothesis, fit.theta, experiment, scaled)))]
    fit = evaluate(fit.hypothesis, fit.theta, experiment, best)
    if worst_row(fit) < STRANGE and best is not scaled[-1]:
        return best
    return adapt_noise(fit, experiment, 2, (*SENSOR_MOVES, *NOISE_MOVES))
