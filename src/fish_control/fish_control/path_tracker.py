# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One robot on one path, and the end of its approach: it is on its path, heads along it and has its speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_control.path_batch import PathBatch, TrackerConfig
from fish_control.reference_path import ReferencePath

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PathPoint:
    """Where the robot is relative to its path; fields as in PathState, without the batch axis."""

    progress: float  # m
    cross_track_error: float  # m, positive: robot left of the path
    x: float  # m, the path's point at the progress
    y: float  # m
    heading: float  # rad, course of the path
    curvature: float  # 1/m
    target: NDArray[np.float64]  # (2,) m
    chord: float  # rad
    finished: bool


class PathTracker:
    """Keeps one robot's progress along one path; a batch of one."""

    def __init__(self, path: ReferencePath, config: TrackerConfig | None = None) -> None:
        self.path = path
        self._batch = PathBatch([path], config)

    @property
    def progress(self) -> float:
        """Arc length reached so far [m]."""
        return float(self._batch.progress[0])

    def reset(self, progress: float = 0.0) -> None:
        """Follow the path from `progress` [m] on."""
        self._batch.reset(progress)

    def nearest(self, position: ArrayLike, start: float = 0.0) -> float:
        """Progress [m] of the globally nearest point not before `start`, for starting and resuming only."""
        return float(self._batch.nearest(np.reshape(position, (1, 2)), start)[0])

    def update(self, position: ArrayLike) -> PathPoint:
        """Advance to the robot's position (2,) [m]."""
        state = self._batch.update(np.reshape(position, (1, 2)))
        return PathPoint(
            float(state.progress[0]),
            float(state.cross_track_error[0]),
            float(state.point[0, 0]),
            float(state.point[0, 1]),
            float(state.heading[0]),
            float(state.curvature[0]),
            state.target[0],
            float(state.chord[0]),
            bool(state.finished[0]),
        )


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
