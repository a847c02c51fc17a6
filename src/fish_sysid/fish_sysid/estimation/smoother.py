# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""State and missing wrench given the whole trial, or a little of what comes after each start point (Rauch, Tung and Striebel)."""

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


def smooth(history: History) -> tuple[Array, Array]:
    """(xi (T, M, N), standard deviations (T, M, N)) given all measurements (Rauch, Tung and Striebel 1965)."""
    xi, P = history.filtered.copy(), history.filtered_P.copy()
    deviation = np.empty_like(xi)
    deviation[-1] = np.sqrt(np.maximum(np.diagonal(P[-1], axis1=1, axis2=2), 0.0))
    for k in range(len(xi) - 2, -1, -1):
        F, ahead = history.transition[k], history.predicted_P[k + 1]
        # the covariance is close to singular along the constraint: scale before the pseudo-inverse
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(ahead, axis1=1, axis2=2), 1e-18))
        scaled = ahead * scale[:, :, None] * scale[:, None, :]
        inverse = (
            np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
            * scale[:, :, None]
            * scale[:, None, :]
        )
        G = P[k] @ F.transpose(0, 2, 1) @ inverse
        xi[k] += (G @ (xi[k + 1] - history.predicted[k + 1])[..., None])[..., 0]
        P[k] += G @ (P[k + 1] - ahead) @ G.transpose(0, 2, 1)
        deviation[k] = np.sqrt(np.maximum(np.diagonal(P[k], axis1=1, axis2=2), 0.0))
    return xi, deviation


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
