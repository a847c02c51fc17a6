# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stroke means of what camera and IMU measured, and features of the command history beside them.

A fish is taken as a black box that commands drive: its stroke-mean surge is even in the rudder, sway and yaw rate are odd.
Windows of a mean end `lag` before the centre of the pose's window; negative lags cover the window itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.camera import HOLE
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.grid import in_holes
from fish_sysid.prediction.stroke_average import HALF_WINDOW, stroke_mean

Array = NDArray[np.float64]

FIRST, LAST = 1.5, 0.8  # s, centres from the start and before the end of a trial
STEP = 0.45  # s between centres; at whole strokes what is left of a stroke would be the same everywhere
ROTOR, RUDDER = 50.0, 0.25  # rad/s and rad, units of the features
SHORT_PAST = ((-0.5, 1.0), (0.5, 1.0))  # (lag, width) in s
PAST = (*SHORT_PAST, (1.5, 1.5))
LONG_PAST = (*PAST, (3.0, 3.0))


@dataclass(frozen=True)
class StrokeMeans:
    """One trial at C centres where the camera covers the window."""

    t: Array  # (C,) s
    pose: Array  # (C, 3) x, y [m], psi [rad]
    velocity: Array  # (C, 3) u, v [m/s], r [rad/s] over ground, by the camera
    gyro: Array  # (C,) rad/s, NaN where it says nothing: without a gyro, and where it pauses in the window
    even: Array  # (C, 12) features of throttle and squared rudder
    odd: Array  # (C, 8) features odd in the rudder
    throttle: Array  # (C, 2) mean squared rotor speed of the last two seconds, in units of ROTOR^2
    rudder: Array  # (C,) mean rudder in the window, in units of RUDDER


Trials = Sequence[StrokeMeans]


def stroke_means(experiment: Experiment) -> tuple[StrokeMeans, ...]:
    """Every trial's stroke means, every 0.45 s; trials too short for three of them are left out."""
    trials = (_trial(experiment, m) for m in range(len(experiment.names)))
    return tuple(trial for trial in trials if len(trial.t) >= 3)


def _trial(experiment: Experiment, m: int) -> StrokeMeans:
    frames, steps = experiment.frames[m], int(experiment.steps[m])
    t = np.arange(FIRST, steps * DT - LAST, STEP)
    weights = stroke_mean(frames.t, t)
    motion = weights(frames.pose)
    covered = np.isfinite(motion).all(axis=1)
    t, motion = t[covered], motion[covered]
    even, odd, throttle, rudder = features(experiment.commands[:steps, m], t)
    # the same weights on the gyro's angle at the same moments: both means are of the same rate
    turned = DT * (np.cumsum(gyro := filled(experiment.gyro[:steps, m])) - 0.5 * gyro)
    rate = weights.slope[covered] @ np.interp(frames.t, DT * np.arange(steps), turned)
    rate[_pauses(experiment.gyro[:steps, m], t)] = np.nan
    return StrokeMeans(t, motion[:, :3], motion[:, 3:], rate, even, odd, throttle, rudder)


def _pauses(gyro: Array, t: Array) -> NDArray[np.bool_]:
    """Whether the gyro (T,) has a hole in the windows (C,) around t."""
    lost = np.concatenate([[0], np.cumsum(in_holes(np.isfinite(gyro), round(HOLE / DT)))])
    first, last = (np.round((t + side) / DT).astype(int) for side in (-HALF_WINDOW, HALF_WINDOW))
    end = len(gyro)
    return np.asarray(lost[np.clip(last + 1, 0, end)] > lost[np.clip(first, 0, end)])


def filled(values: Array) -> Array:
    """Values (T,) with gaps interpolated; all NaN where nothing was measured."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return np.full_like(values, np.nan)
    return np.interp(np.arange(len(values)), known, values[known])


def features(commands: Array, t: Array) -> tuple[Array, Array, Array, Array]:
    """Even (C, 12) and odd (C, 8) features at centres t (C,), throttle (C, 2), rudder (C,); commands (T, 2)."""
    power, rudder = commands[:, 0] ** 2 / ROTOR**2, commands[:, 1] / RUDDER
    A = past_means(power, t, LONG_PAST)
    R, R2 = past_means(rudder, t, PAST), past_means(rudder**2, t, SHORT_PAST)
    RA = past_means(rudder * power, t, SHORT_PAST)
    ones = np.ones((len(t), 1))
    even = np.hstack([A, np.sqrt(np.maximum(A[:, :3], 0.0)), R2, A[:, :2] * R2, ones])
    odd = np.hstack([R, RA, R[:, :2] * A[:, :2], R[:, :1] ** 3])
    return even, odd, A[:, :2], R[:, 0]


def past_means(values: Array, t: Array, windows: tuple[tuple[float, float], ...]) -> Array:
    """Means (C, W) of values (T,) on the grid over windows that end `lag` before t; 0 before the start."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    columns = []
    for lag, width in windows:
        end = np.clip(np.round((t - lag) / DT).astype(int), 0, len(values))
        start = np.clip(end - round(width / DT), 0, len(values))
        columns.append((total[end] - total[start]) * DT / width)
    return np.array(columns).T.reshape(len(t), len(windows))
