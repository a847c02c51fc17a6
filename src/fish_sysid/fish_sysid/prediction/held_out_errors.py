"""Errors of an identified robot on trials that it was not fitted to, beside those of the robot it began with and the baselines."""

from __future__ import annotations

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.initial_noise import suitable_noise
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


