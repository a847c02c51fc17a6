# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an identification gives: the robot with its errors, the trials, predictions of those left out; and its files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_report.files import write_json
from fish_sim.robot import Robot
from fish_sim.robot_file import save_robot
from fish_sysid.dataset.camera import with_marker
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.shooting.left_out import Step
from fish_sysid.estimation.shooting.prediction_fit import PredictionFit
from fish_sysid.estimation.shooting.residuals import Scale
from fish_sysid.estimation.shooting.start_states import START_TRUST
from fish_sysid.identification_statements import undetermined
from fish_sysid.prediction.kept_noise import with_noise
from fish_sysid.prediction.prediction import ErrorSizes, Estimates, Predictions

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Identification:
    """What came out."""

    fit: Fit
    start: Robot
    training: Experiment
    held_out: Experiment | None  # None: a single trial
    judged: Predictions  # of the held-out trials, or of the only trial
    estimates: Estimates  # of the training trials
    errors: dict[str, ErrorSizes]  # "start", "identified", then the baselines that could be fitted
    # what is wrong with the data or the result, and what can still be said
    statements: tuple[str, ...]
    seconds: float
    camera_delay: float = 0.0  # s, taken out of all trials above
    imu_delay: float = 0.0  # s, taken out of all trials above
    predicted: PredictionFit | None = None  # where the robot was fitted to predictions
    states: str = "filter"  # how the states that predictions start from are estimated
    ahead: float = 0.0  # m, of the camera's point, taken out of all trials above

    @property
    def robot(self) -> Robot:
        """The identified robot, with the delays that its sensors have in the recordings as they are."""
        robot = with_marker(self.fit.robot.without_effect("disturbance"), self.ahead)
        if self.camera_delay:
            robot = robot.with_effect("camera_latency", delay=self.camera_delay)
        if self.imu_delay:
            robot = robot.with_effect("imu_latency", delay=self.imu_delay)
        return with_noise(robot, self.fit.noise, self.states, trust_of(self.predicted))

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters whose uncertainty is about the prior's: the data do not determine them."""
        return undetermined(self.fit, self.predicted)

    @property
    def correlation(self) -> Array:
        """(K, K) of the parameters' errors."""
        deviation = np.sqrt(np.diag(self.fit.covariance))
        matrix: Array = self.fit.covariance / np.outer(deviation, deviation)
        return matrix


def trust_of(predicted: PredictionFit | None) -> Scale:
    """How far start states trust the sensors."""
    return START_TRUST if predicted is None else predicted.found.trust


def write_identification(folder: Path, result: Identification, left_out: Sequence[str]) -> None:
    """Write robot.yaml and identification.json into an existing folder."""
    notes = f"Identified from {', '.join(result.training.names)}."
    save_robot(result.robot, folder / "robot.yaml", result.fit.standard_errors, notes)
    write_json(folder / "identification.json", as_record(result, left_out))


def as_record(result: Identification, left_out: Sequence[str]) -> dict[str, Any]:
    """Plain data: parameters, correlation, biases, noise, errors, statements."""
    fit, unknown = result.fit, set(result.undetermined)
    parameters = {
        name: {"value": value, "std": fit.standard_errors[name], "determined": name not in unknown}
        for name, value in fit.values.items()
    }
    biases = {
        name: {
            "value": result.estimates.bias[m].tolist(),
            "std": result.estimates.bias_std[m].tolist(),
        }
        for m, name in enumerate(result.training.names)
    }
    return {
        "training_trials": list(result.training.names),
        "held_out_trials": list(result.held_out.names) if result.held_out else [],
        "left_out": list(left_out),
        "parameters": parameters,
        "correlation": {
            "names": list(fit.hypothesis.free),
            "matrix": np.round(result.correlation, 4).tolist(),
        },
        "biases": {"order": ["gyro_z", "accel_forward", "accel_left"], "trials": biases},
        "noise": asdict(fit.noise),
        "camera_delay": result.camera_delay,
        "imu_delay": result.imu_delay,
        **_predicted(result),
        "log_likelihood": float(fit.log_likelihood.sum()),
        "samples": float(fit.result.samples.sum()),
        "errors": {name: sizes.as_table() for name, sizes in result.errors.items()},
        "statements": list(result.statements),
        "seconds": result.seconds,
    }


def _predicted(result: Identification) -> dict[str, Any]:
    """What a fit to predictions says beyond its parameters."""
    found = result.predicted
    if found is None:
        return {"fitted_to": "likelihood"}
    return {
        "fitted_to": "predictions",
        "links": found.robot.links,
        "links_judged": [_step(step) for step in found.links_judged],
        "trust": asdict(found.found.trust),
        "spread_over_folds": found.parameter_spread,
        "sensors": {
            name: {"value": value, "std": found.sensor_errors[name]}
            for name, value in found.sensors.items()
        },
        "effects_judged": [_step(step) for step in found.steps],
    }


def _step(step: Step) -> dict[str, Any]:
    """What one candidate did to trials left out."""
    return {
        "name": step.name,
        "gain": step.gain,
        "std": step.deviation,
        "added": step.added,
        "alike": list(step.alike),
    }
