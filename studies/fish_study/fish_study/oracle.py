# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The oracle: it knows which effect to look for and where the parameters are, and may do no more than fit them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fish_report.files import number
from fish_sim.robot import Robot
from fish_study.plant_effects import PLANT_EFFECTS
from fish_study.scenario import Scenario
from fish_study.swim import Readings, kept_trials
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, climb, estimate_noise, evaluate
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import Hypothesis, nominal_hypothesis
from fish_sysid.prediction.prediction import predict, prediction_errors

Array = NDArray[np.float64]

ITERATIONS = 6
HORIZONS = (1.0, 2.0, 5.0)  # s
LEVEL = 0.02  # false alarms of the oracle's test


@dataclass(frozen=True)
class OracleFits:
    """The oracle's fits, the trials that they were made on and those held out."""

    nominal: Fit
    true: Fit
    training: Experiment
    held_out: Experiment

    @property
    def result(self) -> OracleResult:
        """What is kept of them."""
        extra = len(self.true.hypothesis.free) - len(self.nominal.hypothesis.free)
        gain = self.true.log_posterior - self.nominal.log_posterior
        return OracleResult(
            gain, extra, _rms(self.held_out, self.nominal), _rms(self.held_out, self.true)
        )


@dataclass(frozen=True)
class OracleResult:
    """What the oracle finds in one scenario."""

    gain: float  # nats of the true structure over the nominal one, both fitted
    parameters: int  # of the true structure beyond the nominal one
    rms_nominal: list[
        list[float]
    ]  # (horizon, position m, heading rad, speed m/s), held out, refitted nominal structure
    rms_true: list[list[float]]  # true structure fitted

    @classmethod
    def read(cls, content: Mapping[str, Any]) -> OracleResult:
        """From JSON, in which what is not finite is null."""
        tables = (
            [[number(v) for v in row] for row in content[key]]
            for key in ("rms_nominal", "rms_true")
        )
        return cls(number(content["gain"], -np.inf), content["parameters"], *tables)


def as_experiment(readings: Sequence[Readings], encoder: bool) -> Experiment:
    """Readings on the filter's grid, trials named as in the recordings."""
    trials = kept_trials(readings)
    steps = np.array([len(trial.commands) for trial in trials.values()])

    def stack(key: str, filler: float) -> Array:
        one = [getattr(trial, key)[:, 0] for trial in trials.values()]
        table = np.full((steps.max(), len(one), *one[0].shape[1:]), filler)
        for m, values in enumerate(one):
            table[: steps[m], m] = values
        return table

    commands = stack("commands", 0.0)
    gyro, accel, speed = (stack(key, np.nan) for key in ("gyro", "accel", "encoder"))
    frames = tuple(Frames(trial.stamps[0], trial.poses[0]) for trial in trials.values())
    rotor = speed if encoder else np.full_like(speed, np.nan)
    return Experiment(tuple(trials), steps, commands, gyro, accel, rotor, frames, True)


def fit_oracle(
    scenario: Scenario,
    experiment: Experiment,
    held_out: Sequence[str],
    names: Sequence[str] | None = None,
) -> OracleFits:
    """Fit the structure with `names` (default: what is hidden) and the nominal one, from the true values."""
    searched = tuple(scenario.names if names is None else names)
    held = [i for i, name in enumerate(experiment.names) if name in held_out]
    training = [i for i in range(len(experiment.names)) if i not in held]
    data, held_data = experiment.select(training), experiment.select(held or training)
    noise = usual_noise(data)
    surge, sway, yaw = (scenario.noise * w for w in noise.wrench)
    noise = replace(noise, wrench=(surge, sway, yaw))
    nominal = _fit(*with_truth(scenario, ()), data, noise)
    true = _fit(*with_truth(scenario, searched), data, noise)
    again = _from(nominal, true, data)
    nominal = max(nominal, again, key=lambda f: f.log_posterior)
    return OracleFits(nominal, true, data, held_data)


def detects(result: OracleResult, nulls: Sequence[OracleResult]) -> bool:
    """Likelihood-ratio test at LEVEL; where nulls show a heavier tail than chi square, theirs counts."""
    threshold = 0.5 * float(chi2.isf(LEVEL, max(result.parameters, 1)))
    if len(nulls) >= 1.0 / LEVEL / 2.0:
        threshold = max(threshold, float(np.quantile([null.gain for null in nulls], 1.0 - LEVEL)))
    return result.gain > threshold


def with_truth(scenario: Scenario, names: Sequence[str]) -> tuple[Hypothesis, Array]:
    """The nominal robot with these effects free, and theta at the true values of all that is hidden."""
    hypothesis = nominal_hypothesis(Robot(table=PLANT_EFFECTS))
    for name in names:
        hypothesis = hypothesis.with_effect(name, 1.0)
        if name in scenario.effects:
            robot = hypothesis.robot.with_effect(name, **scenario.effects[name])
            hypothesis = replace(hypothesis, robot=robot)
    theta = hypothesis.parametrization.origin().copy()
    for i, name in enumerate(hypothesis.free):
        if name in scenario.parameters:
            theta[i] = np.log(scenario.parameters[name])
    return hypothesis, theta


def _fit(hypothesis: Hypothesis, theta: Array, data: Experiment, noise: Noise) -> Fit:
    fit = climb(evaluate(hypothesis, theta, data, noise), data, ITERATIONS)
    return climb(evaluate(hypothesis, fit.theta, data, estimate_noise(fit, data)), data, ITERATIONS)


def _from(base: Fit, rival: Fit, data: Experiment) -> Fit:
    """The base's structure from the rival's nominal parameters."""
    theta = rival.theta[: len(base.theta)]
    return climb(evaluate(base.hypothesis, theta, data, base.noise), data, ITERATIONS)


def _rms(held_out: Experiment, fit: Fit) -> list[list[float]]:
    sizes = prediction_errors(predict(held_out, fit.robot, fit.noise, max(HORIZONS)), HORIZONS)
    return [[float(v) for v in row] for row in sizes.rms]
