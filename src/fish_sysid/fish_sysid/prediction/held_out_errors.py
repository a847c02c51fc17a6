# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Errors of an identified robot on trials that it was not fitted to, beside its start's and the baselines'."""

from __future__ import annotations

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.initial_noise import initial_noise
from fish_sysid.prediction.baselines import fit_baselines, predict_baseline
from fish_sysid.prediction.prediction import (
    EVERY,
    HORIZONS,
    WARM_UP,
    ErrorSizes,
    Predictions,
    predict,
    prediction_errors,
)
from fish_sysid.prediction.stroke_average import HALF_WINDOW

BASELINES = ("constant", "arx", "bilinear")
AHEAD, PEEK = "_ahead", HALF_WINDOW  # suffix of predictors that know so many s of what comes


def judge(
    training: Experiment, held_out: Experiment | None, start: Robot, fitted: Robot, noise: Noise
) -> tuple[Predictions, dict[str, ErrorSizes], list[str]]:
    """Predictions, errors of both robots and of the baselines, and what could not be had, on the held-out trials."""
    unseen = held_out or training
    longest = max(HORIZONS)
    judged = predict(unseen, fitted, noise, longest, EVERY, WARM_UP)
    peeking = predict(unseen, fitted, noise, longest, EVERY, WARM_UP, PEEK)
    before = predict(unseen, start, initial_noise(unseen, start, noise), longest, EVERY, WARM_UP)
    errors = {"start": prediction_errors(before), "identified": prediction_errors(judged)}
    try:
        baselines = fit_baselines(training)
    except ValueError as error:
        return judged, errors, [f"no baselines: {error}"]
    for name, advance in baselines.items():
        errors[name] = prediction_errors(predict_baseline(advance, judged, HALF_WINDOW))
    errors["identified" + AHEAD] = prediction_errors(peeking)
    for name, advance in baselines.items():
        errors[name + AHEAD] = prediction_errors(predict_baseline(advance, judged))
    return judged, errors, []
