# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Errors of one run of a trace, with and without the approach, as `robofish score` defines them for recordings."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fish_control.path_tracker import first_settled, stroke_mean
from fish_control.reference_path import ReferencePath
from fish_train.evaluation.follow import Trace
from fish_train.training.closed_loop_equations import CONTROL_PERIOD

Array = NDArray[np.float64]
LOST = 0.3  # m, after the approach a run that gets this far from its path has failed


@dataclass(frozen=True)
class ErrorSizes:
    """Of a stretch of a run."""

    cross_track_rmse: float  # m
    cross_track_mean: float  # m, of the absolute value
    cross_track_p95: float  # m
    cross_track_max: float  # m
    heading_rmse: float  # rad, course of the path minus mean heading over a stroke
    speed_rmse: float  # m/s, wanted minus surge speed, each stroke's ripple included
    speed_mean: float  # m/s, of the absolute value
    speed_p95: float  # m/s
    rudder_rate_rms: float  # rad/s, of the set-point
    throttle_mean: float


NO_SIZES = ErrorSizes(*(float("nan") for _ in fields(ErrorSizes)))


@dataclass(frozen=True)
class RunMetrics:
    """One run."""

    settled: ErrorSizes  # after the approach; NaN if it never ended
    whole: ErrorSizes
    approach: float  # s; NaN if it never ended
    failure: str  # empty, or what went wrong; all sizes are NaN where the motion diverged


def measure(trace: Trace, run: int, path: ReferencePath) -> RunMetrics:
    """Metrics of robot `run` of a trace."""
    rows = np.isfinite(trace.cross_track[:, run])  # up to the run's end
    if not rows.any() or not np.all(
        np.isfinite(trace.motion[rows, run])
    ):  # small as its errors were before
        return RunMetrics(NO_SIZES, NO_SIZES, float("nan"), "the motion diverged")
    time, motion = trace.time[rows], trace.motion[rows, run]
    cross_track, progress = trace.cross_track[rows, run], trace.progress[rows, run]
    speed = trace.speed[run]
    mean_heading = stroke_mean(time, motion[:, 2])
    heading = np.angle(np.exp(1j * (trace.course[rows, run] - mean_heading)))
    speed_error = speed - motion[:, 3]
    errors = np.column_stack(
        [cross_track, heading, speed_error, trace.alpha[rows, run], trace.throttle[rows, run]]
    )
    first = first_settled(time, progress, cross_track, heading, speed_error, speed)
    approach = float(time[first] - time[0]) if first < len(time) else float("nan")
    arrived = bool(trace.finished[run] or (path.closed and progress[-1] >= path.length))
    failure = _failure(arrived, path, errors[first:, 0])
    if trace.left[run]:
        failure = f"came to the pool's wall at ({motion[-1, 0]:.2f}, {motion[-1, 1]:.2f}) m after {time[-1]:.1f} s"
    return RunMetrics(_sizes(errors[first:]), _sizes(errors), approach, failure)


def _failure(arrived: bool, path: ReferencePath, settled: Array) -> str:
    """What went wrong; arrived: at the end of an open path, once round a closed one, which has time for more."""
    if len(settled) == 0:
        return "never came onto the path"
    if np.abs(settled).max() > LOST:
        return f"left the path by more than {LOST} m"
    if not arrived:
        return "did not go round in time" if path.closed else "did not reach the end in time"
    return ""


def _sizes(errors: Array) -> ErrorSizes:
    """Of columns cross-track, heading, speed, alpha, throttle."""
    if len(errors) < 2:
        return NO_SIZES
    size = np.abs(errors)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    rate = np.diff(errors[:, 3]) / CONTROL_PERIOD
    values = (
        rms[0],
        size[:, 0].mean(),
        np.percentile(size[:, 0], 95),
        size[:, 0].max(),
        rms[1],
        rms[2],
        size[:, 2].mean(),
        np.percentile(size[:, 2], 95),
        np.sqrt(np.mean(rate**2)),
        errors[:, 4].mean(),
    )
    return ErrorSizes(*map(float, values))
