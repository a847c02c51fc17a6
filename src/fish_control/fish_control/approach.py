# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The end of the approach: the first moment at which a fish is on its path, heads along it and has its speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STROKE = 0.5  # s, one rotor period at 2 Hz
NEAR_PATH = 0.05  # m
NEAR_HEADING = 0.3  # rad
NEAR_SPEED = 0.2  # share of the commanded speed


def first_settled(
    t: Array,
    progress: Array,
    cross_track: Array,
    heading: Array,
    speed_error: Array,
    wanted: float | Array,
) -> int:
    """The first sample after the approach phase, N if the run never got there; wanted: speed [m/s]."""
    near = (
        (progress > progress[0])
        & (np.abs(cross_track) < NEAR_PATH)
        & (np.abs(heading) < NEAR_HEADING)
        & (np.abs(stroke_mean(t, speed_error)) < NEAR_SPEED * wanted)
    )
    return int(np.argmax(near)) if near.any() else len(t)


def stroke_mean(t: Array, value: Array) -> Array:
    """Mean over one stroke around each sample, of the piecewise linear signal; shorter at the ends."""
    if len(t) < 2:
        return value.copy()
    integral = np.r_[0.0, np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(t))]
    before, after = np.maximum(t - STROKE / 2, t[0]), np.minimum(t + STROKE / 2, t[-1])
    whole = np.interp(after, t, integral) - np.interp(before, t, integral)
    return np.asarray(whole / np.maximum(after - before, 1e-9))
