"""States at start points, given what was measured before them and a little of what comes after."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_train.identify.filter_types import Array, History
from fish_train.identify.smoother import smooth


def smoothed_at(history: History, starts: NDArray[np.int64], steps: NDArray[np.int64], ahead: float) -> Array:
    """(S, N) moments at starts (S, 2) of trial and grid point, given all up to `ahead` [s] after each (fixed-lag smoother).

    steps: (M,) grid points of each trial, which nothing is taken from beyond. NaN where the filter diverged.
    """
    trial, first = starts.T
    rows = np.minimum(first + np.arange(round(ahead / DT) + 1)[:, None], steps[trial] - 1)
    windows = {f.name: getattr(history, f.name)[rows, trial] for f in fields(History)}
    good = np.isfinite(windows["filtered"]).all(axis=(0, 2))
    out = np.full((len(starts), history.filtered.shape[2]), np.nan)
    out[good] = smooth(History(**{name: values[:, good] for name, values in windows.items()}))[0][0]
    return out
