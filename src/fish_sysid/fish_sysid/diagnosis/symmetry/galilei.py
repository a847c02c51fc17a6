# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Uniform flow by Galilei's change of frame.

A fish in water that moves swims as in still water, and is carried along:

    stroke-mean ground velocity = R(heading) f(command history) + V

f is any function of the commands: least squares on 12 even features for surge and 8 odd ones for sway, the latter with terms of
a hull that is not mirror-symmetric. Nothing about water and fish enters f that turning the pool could change, so only a
velocity that is constant in the pool frame is left for V.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sysid.dataset.grid import in_base_link
from fish_sysid.diagnosis.symmetry.regression import Conclusion, Judged, RegressionTest, Rows
from fish_sysid.diagnosis.symmetry.stroke_means import StrokeMeans, Trials
from fish_sysid.estimation.thresholds import SYMMETRY_GAIN

Array = NDArray[np.float64]

TOO_FEW_HEADINGS = (
    "too few headings: all but {:.0%} of what a flow does could be the fish's own swimming"
)


def ground_velocity(trial: StrokeMeans) -> Array:
    """Surge, then sway (2C,) over ground in m/s."""
    return trial.velocity[:, :2].T.ravel()


def black_box(trial: StrokeMeans) -> Array:
    """Columns (2C, 23) of what commands may do to surge and sway, sway with terms of an asymmetric hull."""
    lateral = np.hstack([trial.odd, asymmetric(trial)])
    return block_diagonal(trial.even, lateral)


def asymmetric(trial: StrokeMeans) -> Array:
    """Columns (C, 3) that the sway of a mirror-symmetric fish cannot have."""
    return np.column_stack([np.ones_like(trial.t), trial.throttle])


def block_diagonal(surge: Array, sway: Array) -> Array:
    """Columns (2C, P + Q) of surge (C, P) and sway (C, Q)."""
    above = np.hstack([surge, np.zeros((len(surge), sway.shape[1]))])
    return np.vstack([above, np.hstack([np.zeros((len(sway), surge.shape[1])), sway])])


def in_body_frame(trial: StrokeMeans, velocity: Array) -> Array:
    """Surge, then sway (2C,) of pool-frame velocities (C, 2)."""
    x, y = velocity.T
    return np.concatenate(in_base_link(x, y, trial.pose[:, 2]))


def carried(trial: StrokeMeans) -> Array:
    """Columns (2C, 2) of flows of 1 m/s along x and along y."""
    flows = (np.tile(axis, (len(trial.t), 1)) for axis in np.eye(2))
    return np.column_stack([in_body_frame(trial, flow) for flow in flows])


def _rows(trial: StrokeMeans) -> Rows:
    return Rows(black_box(trial), carried(trial), ground_velocity(trial))


def _flow(judged: Judged, _: Trials) -> Conclusion:
    x, y = judged.estimate(-2, "m/s"), judged.estimate(-1, "m/s")
    text = f"the water moves by ({x.value:.3f} ± {x.std:.3f}, {y.value:.3f} ± {y.std:.3f}) m/s"
    return judged.stands(SYMMETRY_GAIN, -2, -1), text, {"x": x, "y": y}


UNIFORM_FLOW = RegressionTest(
    "current",
    "physics",
    assumes="the water's velocity is the same everywhere and at all times; commands alone drive the fish",
    needs="three trials and several headings at the same commands",
    rows=_rows,
    spanned=TOO_FEW_HEADINGS,
    conclude=_flow,
)
