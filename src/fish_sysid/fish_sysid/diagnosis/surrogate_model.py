# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Surrogate model: where no name fits, the robot whose predictions over seconds are best.

The likelihood misleads a model that lacks something without a name: its parameters go where the next 50 ms are right. Here the
robot is fitted to predictions (`estimation.shooting`), from the values that were given, and gets the effects that trials left out
ask for. It serves simulation and training. What its effects do to predictions of trials left out is evidence of its own (`basis`
"prediction", `prediction_evidence`). Where the nominal fit predicts the training trials better, that is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import AHEAD, MARKER, ahead_of, at_centre_of_mass
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.prediction_rivals import Named, with_rivals
from fish_sysid.estimation.ekf_types import SensorModel
from fish_sysid.estimation.map_fit import Fit, evaluate, initial_noise
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import sensor_model
from fish_sysid.estimation.shooting.prediction_fit import PLACE, PredictionFit, fit_predictions
from fish_sysid.estimation.shooting.schedule import can_be_predicted
from fish_sysid.estimation.shooting.selection import INTRINSIC
from fish_sysid.estimation.shooting.start_states import without_sensor_errors
from fish_sysid.prediction.better_states import better_states, prediction_size
from fish_sysid.prediction.kept_noise import with_noise

Array = NDArray[np.float64]

STRUCTURAL = ("tip_slip", "quadratic_drag")  # screening says little of them on a poor base


def surrogate_model(
    nominal: Fit,
    candidates: Sequence[str],
    experiment: Experiment,
    report: Callable[[str], None],
) -> tuple[Fit, tuple[Named, ...]]:
    """(the model that predicts best, the effects in it with what each does to predictions of trials left out, and its rivals).

    nominal: the fit without effects but those that symmetry tests find: late images are moved back before anything is fitted;
    candidates: effects that may help. The nominal fit itself where no trial is long enough to predict.
    """
    if not can_be_predicted(experiment):
        return nominal, ()
    report("no name fits: fitting predictions over seconds")
    robot = nominal.hypothesis.robot.without_effect("disturbance")
    free = [name for name in nominal.hypothesis.free if "." not in name]
    moving = moving_effects(candidates, robot)
    seen = without_sensor_errors(experiment, nominal.robot)
    found = fit_predictions(seen, robot, free, (), moving, report, together=INTRINSIC)
    fit = _as_fit(found, sensor_model(nominal.robot), experiment)
    own, other = (
        prediction_size(experiment, f.robot, f.noise) for f in (fit, _with_filter(nominal))
    )
    if own >= other:
        return nominal, ()
    report("members of a family in each other's place")
    return fit, with_rivals(seen, found.found, [s for s in found.steps if s.name in moving])


def moving_effects(candidates: Sequence[str], robot: Robot) -> list[str]:
    """The candidates that move a fish, as no sensor does, and that the robot has not yet."""
    return [name for name in candidates if name in robot.table and name not in robot.effects]


def _as_fit(found: PredictionFit, before: SensorModel, experiment: Experiment) -> Fit:
    """The fit to predictions with its sensors, noise and way to start states; before: what the data were corrected for."""
    hypothesis, K = found.found.hypothesis, len(found.theta)
    late = max(before.camera_latency + found.sensors["camera_latency.delay"], 0.0)
    offset = before.camera_heading_offset + found.sensors["camera_heading_offset.offset"]
    sensors = {
        **hypothesis.robot.sensors,
        "camera_latency": {"delay": late},
        "camera_heading_offset": {"offset": offset},
        MARKER: {AHEAD: found.sensors[PLACE]},
    }
    settled = replace(hypothesis.robot, sensors=sensors)
    centred = at_centre_of_mass(experiment, ahead_of(settled))
    noise = initial_noise(centred, settled.without_effect("disturbance"), usual_noise(centred))
    fit = evaluate(replace(hypothesis, robot=settled), found.theta, centred, noise)
    states = better_states(
        experiment, fit.robot.without_effect("disturbance"), noise, found.found.trust
    )
    kept = with_noise(fit.robot, noise, states, found.found.trust)
    information = np.linalg.inv(found.covariance[:K, :K])
    return replace(fit, robot=kept, information=np.asarray(information, dtype=float))


def _with_filter(fit: Fit) -> Fit:
    return replace(fit, robot=fit.robot.without_effect("disturbance"))
