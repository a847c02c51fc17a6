# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""States at start points, given what was measured before them and a little of what comes after."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf import run_filter
from fish_sysid.estimation.ekf_types import Array, History, Noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.smoother import smooth


def smoothed(
    experiment: Experiment, robot: Robot, noise: Noise, starts: NDArray[np.int64], ahead: float
) -> Array:
    """(S, N) filter states at starts (S, 2) of trial and grid point, given all up to `ahead` [s] after each.

    NaN where the filter diverged. Trials are filtered one at a time, as histories are large.
    """
    coordinates = nominal_hypothesis(robot, free=()).parametrization
    p, dp, sensors = coordinates.filter_inputs(np.zeros(0))
    parts = {}
    for m in np.unique(starts[:, 0]).tolist():
        alone = experiment.select([m])
        history = run_filter(alone, coordinates.stepper, p, dp, sensors, noise, keep=True).history
        assert history is not None
        parts[m] = _at(history, starts[starts[:, 0] == m, 1], int(alone.steps[0]), ahead)
    out = np.full((len(starts), next(iter(parts.values())).shape[1]), np.nan)
    for m, states in parts.items():
        out[starts[:, 0] == m] = states
    return out


def _at(history: History, starts: NDArray[np.int64], steps: int, ahead: float) -> Array:
    """(S, N) of one trial: the smoother runs back from `ahead` after each start, or from the trial's end."""
    rows = starts + np.arange(round(ahead / DT) + 1)[:, None]
    beyond, rows = rows >= steps, np.minimum(rows, steps - 1)
    windows = {f.name: getattr(history, f.name)[rows, 0] for f in fields(History)}
    # all windows have one length; past a trial's end its last row is repeated, where filtered equals predicted, so that the
    # last measurement is used once
    for predicted, filtered in (("predicted", "filtered"), ("predicted_P", "filtered_P")):
        windows[predicted][beyond] = windows[filtered][beyond]
    good = np.isfinite(windows["filtered"]).all(axis=(0, 2))
    out = np.full((len(starts), history.filtered.shape[2]), np.nan)
    out[good] = smooth(History(**{name: values[:, good] for name, values in windows.items()}))[0][0]
    return out
