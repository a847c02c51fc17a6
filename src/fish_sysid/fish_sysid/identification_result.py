# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an identification gives: the robot with its errors, the trials, and how well it predicts those left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.marker_place import with_marker
from fish_sysid.estimation.map_fit import Fit
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
    statements: tuple[
        str, ...
    ]  # what is wrong with the data or the result, and what can still be said
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
