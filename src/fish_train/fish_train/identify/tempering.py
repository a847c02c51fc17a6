"""A cold fit that finds the right optimum: the IMU is believed little at first and more and more.

With the accelerometer's and gyro's full weight the likelihood has many optima, because a wrong phase of the tail's swing is
as bad as no swing at all. With their standard deviations a hundred times as large the camera leads, and the nominal values
lead to the optimum from 30 % away; each further stage starts from the one before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_train.identify.experiment import Experiment
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import NOISE_MOVES, SENSOR_MOVES, Fit, adapt_noise, climb, evaluate
from fish_train.identify.hypothesis import Coordinates, Hypothesis
from fish_train.identify.settle import STRANGE, open_gates, worst_row

Array = NDArray[np.float64]

STAGES = ((100.0, 25), (30.0, 25), (10.0, 15), (3.0, 15), (1.0, 15))  # factor of the IMU's noise, iterations
HELD_AT_FIRST = (
    "link_inertia_factor",
    "fin_inertia_factor",
)  # far from the optimum they imitate a wrong phase of the tail
ROUNDS = 2  # of noise estimation and refits


def fit_tempered(
    hypothesis: Hypothesis, experiment: Experiment, noise: Noise, theta: Array | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Fit:  # fmt: skip
    """Fit from `theta` (default: the hypothesis's start values), then estimate the process noise, in turn.

    Where the first stage leaves innovations that the sensors' noise cannot explain, that noise is estimated as well.
    The last steps leave out outliers by the gates of `noise`.
    """
    theta = Coordinates(hypothesis).origin() if theta is None else theta.copy()
    first = [i for i, name in enumerate(hypothesis.free) if name not in HELD_AT_FIRST]
    coarse = _fixing(hypothesis, theta)
    for factor, iterations in STAGES:
        report(f"fitting, IMU noise x {factor:g}")
        wide = replace(open_gates(noise), gyro=factor * noise.gyro, accel=factor * noise.accel)
        fit = climb(evaluate(coarse, theta[first], experiment, wide), experiment, iterations)
        theta[first] = fit.theta
        if worst_row(fit) > STRANGE:
            return _fit_with_sensor_noise(evaluate(hypothesis, theta, experiment, wide), experiment, report)
    fit = climb(evaluate(hypothesis, theta, experiment, noise), experiment, STAGES[-1][1])
    for _ in range(ROUNDS):
        report("fitting, process noise")
        adapted = replace(
            adapt_noise(fit, experiment), gate_camera=noise.gate_camera, gate_imu=noise.gate_imu
        )
        fit = climb(evaluate(hypothesis, fit.theta, experiment, adapted), experiment, 8)
    return fit


def _fixing(hypothesis: Hypothesis, theta: Array) -> Hypothesis:
    """The hypothesis with the parameters of HELD_AT_FIRST fixed at theta."""
    robot = Coordinates(hypothesis).robot(theta)
    held = {name: robot.parameters[name] for name in hypothesis.free if name in HELD_AT_FIRST}
    free = tuple(name for name in hypothesis.free if name not in HELD_AT_FIRST)
    return Hypothesis(hypothesis.robot.with_parameters(**held), free)


def _fit_with_sensor_noise(fit: Fit, experiment: Experiment, report: Callable[[str], None]) -> Fit:
    """Alternate between all noise and parameters, gates open."""
    for _ in range(ROUNDS + 1):
        report("fitting, noise of sensors and process")
        adapted = adapt_noise(fit, experiment, 2, (*SENSOR_MOVES, *NOISE_MOVES))
        fit = climb(evaluate(fit.hypothesis, fit.theta, experiment, adapted), experiment, 8)
    return fit
