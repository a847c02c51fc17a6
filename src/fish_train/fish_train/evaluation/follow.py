# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A batch of robots on a batch of paths: sensing, planner's and controller's laws, plant, 10 ms at a time; and its errors.

The laws are those of the nodes (fish_control's generic functions) on arrays of B robots; the node's handling of a fish
that faces backwards, of stale data and of the end of a path is not part of it. The errors of a run, with and without the
approach, are as `robofish score` defines them for recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_control.control_law import (
    ActuatorState,
    ControlState,
    Errors,
    Setpoint,
    actuator_step,
    control_step,
)
from fish_control.line_of_sight import (
    GuidanceState,
    Motion,
    PathAhead,
    has_listened,
    heading_error,
    mean_heading,
    observe,
    through_water,
    tracking_errors,
)
from fish_control.path_batch import PathBatch
from fish_control.path_tracker import first_settled, stroke_mean
from fish_control.pool import HALF_LENGTH, HALF_WIDTH, wall_distance
from fish_control.reference_path import ReferencePath
from fish_sim.model import DT
from fish_train.evaluation.candidates import GainsSource
from fish_train.evaluation.plant import Plant, Sensing
from fish_train.training.closed_loop_equations import CONTROL_PERIOD, PHYSICS_STEPS, Law

Array = NDArray[np.float64]
LOST = 0.3  # m, after the approach a run that gets this far from its path has failed


@dataclass(frozen=True)
class Trace:
    """What happened, every control period (20 ms); (T, B, ...) arrays, NaN after a robot's end.

    Attributes:
        time: (T,) [s]. motion: (T, B, 6) true motion. cross_track [m], course [rad] (of the path), progress [m]: of the
            true position, (T, B). alpha [rad], throttle: set-points (T, B). gains: (T, B, 6).
        speed: (B,) wanted [m/s]. finished: (B,) reached the end of an open path. left: (B,) came to a wall of the pool.
    """

    time: Array
    motion: Array
    cross_track: Array
    course: Array
    progress: Array
    alpha: Array
    throttle: Array
    gains: Array
    speed: Array
    finished: NDArray[np.bool_]
    left: NDArray[np.bool_]


class Follower:
    """The laws' memory for a batch."""

    def __init__(
        self, paths: Sequence[ReferencePath], speed: Array, gains: GainsSource, law: Law
    ) -> None:
        self._law, self._gains, self._speed = law, gains, np.asarray(speed, dtype=float)
        self._paths = PathBatch(paths, law.tracker)
        zeros = np.zeros(len(paths))
        self._guidance = GuidanceState.of([zeros + value for value in GuidanceState().flat])
        self._control = ControlState(*(zeros for _ in ControlState._fields))
        self._actuator = ActuatorState(*(zeros for _ in ActuatorState._fields))
        self.setpoint = Setpoint(zeros, zeros)
        self._listened, self._swims = zeros, np.zeros(len(paths), dtype=bool)
        self.gains = np.full((len(paths), 6), np.nan)

    def observe(self, seen: Array, known: NDArray[np.bool_]) -> None:
        """Take in what is seen (B, 6); robots without an estimate yet keep their memory."""
        law, before = self._law, self._guidance
        after = observe(before, Motion(*seen.T), self.setpoint, DT, law.limits, law.guidance, np)
        self._guidance = GuidanceState.of(_updated(known, after.flat, before.flat))
        self._listened = self._listened + DT * known

    def decide(self, seen: Array, known: NDArray[np.bool_]) -> None:
        """One control period of planner, policy and control law."""
        motion, at = Motion(*seen.T), self._paths.update(seen[:, :2])
        (x, y), (target_x, target_y) = at.point.T, at.target.T
        ahead = PathAhead(x, y, at.heading, at.curvature, target_x, target_y, at.chord)
        state, guidance = self._guidance, self._law.guidance
        errors = tracking_errors(state.stroke, motion, ahead, self._speed, guidance, np)
        water = through_water(state, errors.course, at.curvature, self._speed, np)
        e_psi = heading_error(state, motion, water, guidance, np)
        heading = mean_heading(state.stroke, motion)
        situation = (heading, motion.surge, self._speed, e_psi, errors.speed, errors.cross_track)
        gains = self._gains.gains(situation, self._speed, at.curvature)
        wanted = Errors(e_psi, errors.speed, water.curvature, water.speed, state.water.thrust)
        control, setpoint = control_step(
            self._control, wanted, gains, CONTROL_PERIOD, self._law.limits, np
        )
        self._swims = self._swims | (known & has_listened(self._listened, motion, guidance, np))
        swims = known & self._swims
        self._control = ControlState(*_updated(swims, control, self._control))
        self.setpoint = Setpoint(*(np.where(swims, a, 0.0) for a in setpoint))
        self.gains = np.stack(gains, axis=-1)

    def command(self) -> Array:
        """Commands (B, 2) for the next 10 ms."""
        self._actuator, rotor_speed = actuator_step(
            self._actuator, self.setpoint, DT, self._law.limits, np
        )
        return np.column_stack([rotor_speed, self._actuator.alpha])


def _updated(known: NDArray[np.bool_], new: Sequence[Array], old: Sequence[Array]) -> list[Array]:
    """New values (B,) of the robots that are known, old ones of the others."""
    return [np.where(known, a, b) for a, b in zip(new, old, strict=True)]


def follow(
    plant: Plant,
    sensing: Sensing,
    gains: GainsSource,
    paths: Sequence[ReferencePath],
    speed: Array,
    starts: Array,
    durations: Array,
    law: Law,
) -> Trace:
    """Swim from rest at `starts` (B, 3); a robot ends with its path, after its duration [s] (B,), or at a wall of the pool.

    Walls count where path and start lie within them: paths of any size can be swum in water without an end.
    """
    plant.reset(starts)
    follower, judge = Follower(paths, speed, gains, law), PathBatch(paths, law.tracker)
    durations = np.asarray(durations, dtype=float)
    finished, ended, left = (np.zeros(len(paths), dtype=bool) for _ in range(3))
    starts = np.asarray(starts, dtype=float)
    walled = np.array(
        [
            wall_distance(np.vstack([p.points, at[None, :2]])) > 0.0
            for p, at in zip(paths, starts, strict=True)
        ]
    )
    rows: list[list[Array]] = []
    for k in range(1, PHYSICS_STEPS * int(np.ceil(durations.max() / CONTROL_PERIOD)) + 1):
        plant.step(follower.command())
        time, motion = k * DT, plant.motion
        lost = ~np.all(np.isfinite(motion), axis=1)
        seen, known = sensing.update(time, np.where(lost[:, None], 0.0, motion))
        follower.observe(seen, known)
        if k % PHYSICS_STEPS:
            continue
        follower.decide(seen, known)
        at = judge.update(np.where(lost[:, None], 0.0, motion)[:, :2])
        row = (
            motion,
            at.cross_track_error,
            at.heading,
            at.progress,
            *follower.setpoint,
            follower.gains,
        )
        rows.append([np.where(ended, np.nan, value.T).T for value in row])
        finished |= at.finished & ~ended
        left |= walled & np.any(np.abs(motion[:, :2]) >= [HALF_LENGTH, HALF_WIDTH], axis=1) & ~ended
        ended |= at.finished | (time >= durations) | lost | left
        if ended.all():
            break
    time_axis = CONTROL_PERIOD * np.arange(1, len(rows) + 1, dtype=float)
    columns: list[Array] = [np.array(column) for column in zip(*rows, strict=True)]
    names = ("motion", "cross_track", "course", "progress", "alpha", "throttle", "gains")
    recorded: dict[str, Any] = dict(zip(names, columns, strict=True))
    return Trace(
        time_axis, **recorded, speed=np.asarray(speed, dtype=float), finished=finished, left=left
    )


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
