# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What swims say of a model's parameters, and how its filter answers to what the model lacks.

    N = sum of J' J,   J = d e / d theta      e: whitened innovations of the filter that fits the model (`estimation.ekf_types`)

The filter is fed with noise-free recordings: those of the model's own robot give N, the information of a design; those of a robot
that has something else give the signal that `identify` and `diagnose` would see.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.design.noise_free import SensorSet, Swims, shown
from fish_sysid.estimation.ekf import run_filters
from fish_sysid.estimation.ekf_types import Noise, Problem
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import Hypothesis

Array = NDArray[np.float64]

STEP = 0.01  # of theta, for differences


def information(hypothesis: Hypothesis, swims: Swims, sensors: SensorSet, noise: Noise) -> Array:
    """(M, K, K) what each swim says of theta where the robot is that of the hypothesis."""
    theta = hypothesis.parametrization.origin()
    recorded = shown(hypothesis.parametrization.robot(theta), swims, sensors)
    return evaluate(hypothesis, theta, recorded, noise.ungated()).result.normal


def innovations(hypothesis: Hypothesis, experiment: Experiment, noise: Noise) -> Array:
    """(R,) whitened innovations of the hypothesis's filter, without gates, 0 where nothing is measured."""
    p, _, sensors = hypothesis.parametrization.filter_inputs(hypothesis.parametrization.origin())
    plain = replace(sensors, free={}, slope={})
    stepper = hypothesis.parametrization.stepper
    problem = Problem(experiment, stepper, p, np.zeros((0, len(p))), plain)
    (found,) = run_filters(problem, [noise.ungated()])
    return np.nan_to_num(found.whitened).ravel()


def signals_of_parameters(
    hypothesis: Hypothesis, swims: Swims, sensors: SensorSet, noise: Noise, base: Array
) -> Array:
    """(R, K) change of the innovations, from base (R,), for each unit of theta by which the robot differs from the model."""
    coordinates = hypothesis.parametrization
    theta = coordinates.origin()

    def change(k: int) -> Array:
        moved = theta.copy()
        moved[k] += STEP
        robot: Robot = coordinates.robot(moved)
        return (innovations(hypothesis, shown(robot, swims, sensors), noise) - base) / STEP

    return np.array([change(k) for k in range(len(theta))]).T.reshape(len(base), len(theta))
