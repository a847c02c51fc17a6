# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor with a clock of its own, as if it had measured at the times of the filter's grid.

A sample 4 ms off that is taken for one of the grid's looks like a camera that is late by as much, one of an encoder like a rotor
that lags. Between samples runs a spline of the fifth degree: it keeps white noise nearly white (at worst, half-way between two
samples, 0.83 of the variance and 1.2 times the density that such a variance has at low frequencies; a straight line has 0.5 and
1.9) and follows 20 Hz to 0.1 % of the amplitude where 100 samples come in a second.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

Array = NDArray[np.float64]

DEGREE = 5
GAP = 2.5  # periods between two samples that no spline bridges
CLOSE = 0.3  # periods; across samples so close together, noise would throw a curve far off
ROUNDING = 1e-6  # s, of stamps
EARLY = 0.05  # steps by which a sample may come too early to stand alone at its grid point: a clock that runs a little fast


def on_grid(t: Array, values: Array, grid: Array, step: float) -> Array:
    """(G, ...) values at the times grid (G,) of samples (N, ...) with stamps t (N,) in order; all times in s.

    A grid point has a value where a sample lies within half a step and the samples reach to both sides of it: as many values as
    there were samples that come every step or more slowly, one at every grid point of faster ones. Elsewhere NaN.
    """
    out = np.full((len(grid), *values.shape[1:]), np.nan)
    if not len(t):
        return out
    t, first = np.unique(t, return_index=True)
    values, period = values[first], float(np.median(np.diff(t))) if len(t) > 1 else step
    around = np.concatenate([[-np.inf], t, [np.inf]])
    after = np.searchsorted(t, grid) + 1
    near = np.minimum(grid - around[after - 1], around[after] - grid) <= 0.5 * step + ROUNDING
    for run in np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > GAP * period) + 1):
        own = near & (grid >= t[run[0]] - ROUNDING) & (grid <= t[run[-1]] + ROUNDING)
        out[own] = _curve(t[run], values[run], grid[own], period)
    return out


def apart(t: Array, step: float) -> NDArray[np.int64]:
    """Which samples with stamps t (N,) [s] in order to keep so that each finds a grid point of its own, wherever the grid begins.

    Those that come a step or more after each other are all kept. Of faster ones, two at one grid point would have to be one.
    """
    kept, free = [], -np.inf
    for i, now in enumerate(t.tolist()):
        if now >= free - EARLY * step:
            kept.append(i)
            free = max(now, free) + step
    return np.array(kept, dtype=np.int64)


def _curve(t: Array, values: Array, at: Array, period: float) -> Array:
    """(A, ...) values between the samples of a run without gaps."""
    if len(t) == 1 or not len(at):
        return np.repeat(values[:1], len(at), axis=0)
    smooth = len(t) > DEGREE and np.diff(t).min() > CLOSE * period
    curve: Array = make_interp_spline(t, values, k=DEGREE if smooth else 1)(
        np.clip(at, t[0], t[-1])
    )
    return curve
