# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An identification as files: robot.yaml with standard errors, and everything else as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fish_report.json_file import write_json
from fish_sim.robot_file import save_robot
from fish_sysid.estimation.shooting.left_out import Step
from fish_sysid.identification_result import Identification


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
