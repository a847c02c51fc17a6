# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The IMU's clock, and how its gyro differs from its own orientation, which it integrates at a rate of its own.

A gyro that is read seldom loses fast turns, and the camera sees them seldom; the orientation of the same message lacks neither.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment, Headings

Array = NDArray[np.float64]

WINDOW = 4.0  # s
SPAN = 0.15  # s, over which turns are compared; a sensor of 20 Hz gives three samples
HOLE = 0.1  # s between samples of the gyro, across which nobody knows how it turned
FEWEST = 20  # turns in a window
CLIP = 3.0  # robust deviations; larger differences are lost samples
FEWEST_SAMPLES = 4  # of the gyro


def imu_moved_back(experiment: Experiment, delay: float) -> Experiment:
    """The experiment with gyro and accelerometer `delay` [s] earlier, to the nearest grid point, and orientation exactly."""
    if delay == 0.0:
        return experiment
    steps = round(delay / DT)
    headings = tuple(Headings(h.t - delay, h.psi) for h in experiment.headings)
    return replace(
        experiment,
        gyro=_earlier(experiment.gyro, steps),
        accel=_earlier(experiment.accel, steps),
        headings=headings,
    )


def _earlier(values: Array, steps: int) -> Array:
    """Values (T, ...) a number of grid points earlier; NaN where none are left."""
    out = np.full_like(values, np.nan)
    kept = max(len(values) - abs(steps), 0)
    if steps >= 0:
        out[:kept] = values[len(values) - kept :]
    else:
        out[len(values) - kept :] = values[:kept]
    return out


def orientation_windows(experiment: Experiment, m: int) -> Array:
    """How turns by the IMU's orientation differ from those by the gyro in each window of trial m.

    Returns:
        (W, 2) in rad: projection of the difference, less its mean, on the unit turns by the gyro, and the norm of these. A gyro
        that reads (1 + e) times the rate adds -e times the second to the first. No rows without an orientation.

    """
    gyro, turned = experiment.gyro[: experiment.steps[m], m], experiment.heading_of(m)
    known = np.flatnonzero(np.isfinite(gyro))
    if len(known) < FEWEST_SAMPLES or len(turned.t) < FEWEST:
        return np.zeros((0, 2))
    angle = CubicSpline(DT * known, gyro[known]).antiderivative()
    last = np.searchsorted(turned.t, turned.t + SPAN - 0.25 * DT)
    first = np.flatnonzero(last < len(turned.t))
    last = last[first]
    gap = np.concatenate([[0.0], np.cumsum(np.maximum(DT * np.diff(known) - HOLE, 0.0))])
    holes = np.interp(turned.t, DT * known, gap)
    whole = (turned.t[last] - turned.t[first] < SPAN + HOLE) & (holes[last] == holes[first])
    whole &= (turned.t[first] >= DT * known[0]) & (turned.t[last] <= DT * known[-1])
    first, last = first[whole], last[whole]
    by_gyro = angle(turned.t[last]) - angle(turned.t[first])
    apart = turned.psi[last] - turned.psi[first] - by_gyro
    rows = []
    for start in np.arange(0.0, len(gyro) * DT - WINDOW, WINDOW):
        pick = (turned.t[first] >= start) & (turned.t[first] < start + WINDOW)
        if pick.sum() >= FEWEST:
            x, y = by_gyro[pick] - by_gyro[pick].mean(), apart[pick] - np.median(apart[pick])
            size = max(float(np.linalg.norm(x)), 1e-9)
            spread = CLIP * 1.4826 * float(np.median(np.abs(y)))
            rows.append([float(np.clip(y, -spread, spread) @ x) / size, size])
    return np.array(rows).reshape(-1, 2)
