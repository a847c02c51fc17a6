# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How well a recorded run followed its path: errors over time and their summary, from poses and speeds alone.

    e_y   = n(s) . (p - p(s))        cross-track [m], positive: head left of the path; s: progress, in order
    e_psi = wrap(chi(s) - <psi>)     heading [rad]; <psi>: mean over one stroke of the rotor (0.5 s)
    e_u   = u_ref - u                speed [m/s], the head's surge speed, each stroke's ripple included; u_ref: commanded then

The approach phase lasts until, for the first time, the head is within 0.05 m of the path, the heading
within 0.3 rad of the path's and the surge speed within 20 % of the commanded one (both averaged over a
stroke), while it follows the path (progress > 0). A run ends where its open path ends, or when the planner says so (speed 0).
Frame: pool. Errors are wanted minus actual, the cross-track error apart. Source: this project.

The tables of a scored run, for the terminal and for the page: the same cells in both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_bag.trial import Odometry, ReferenceSpeed, Trial
from fish_bag.trial import ReferencePath as RecordedPath
from fish_control.path_tracker import (
    NEAR_HEADING,
    NEAR_PATH,
    NEAR_SPEED,
    PathTracker,
    first_settled,
    stroke_mean,
)
from fish_control.reference_path import PathError, ReferencePath
from fish_report.errors import UserError
from fish_report.page import Table

Array = NDArray[np.float64]


CLOSED_GAP = 3.0  # a path whose ends are nearer than so many sample distances is closed


@dataclass(frozen=True)
class Summary:
    """Size of an error over a run."""

    rmse: float
    p95: float  # 95th percentile of the absolute value
    maximum: float  # of the absolute value

    @classmethod
    def of(cls, error: Array) -> Summary:
        """Of the samples of an error; nan where there is none."""
        if not len(error):
            return cls(float("nan"), float("nan"), float("nan"))
        size = np.abs(error)
        return cls(
            float(np.sqrt(np.mean(error**2))), float(np.percentile(size, 95)), float(size.max())
        )


@dataclass(frozen=True)
class RunScore:
    """Errors of one run, (N,) samples from the start of the run to its end.

    Attributes:
        source: "truth" (the simulator's own pose) or "estimate" (odometry/filtered).
        t: [s] on the recording's axis. progress: [m] along the path.
        head_angle: heading error of the head as it swings [rad]. heading: of its mean over a stroke [rad].
        settled: first sample after the approach phase, N if the run never got there.
        finished: whether the end of an open path was reached, or the planner said that it was.
    """

    source: str
    path: ReferencePath
    reference_speed: Array  # m/s, commanded
    t: Array
    position: Array  # (N, 2) m
    speed: Array  # (N,) m/s, surge
    progress: Array
    cross_track: Array
    heading: Array
    head_angle: Array
    speed_error: Array
    settled: int
    finished: bool

    @property
    def approach_s(self) -> float:
        """Length of the approach phase [s]; nan if it never ended."""
        return (
            float(self.t[self.settled] - self.t[0]) if self.settled < len(self.t) else float("nan")
        )

    def summaries(self, *, with_approach: bool) -> dict[str, Summary]:
        """Error name -> size, over the whole run or what follows the approach phase."""
        first = 0 if with_approach else self.settled
        errors = {
            "cross-track, m": self.cross_track,
            "heading, rad": self.heading,
            "head angle, rad": self.head_angle,
            "speed, m/s": self.speed_error,
        }
        return {name: Summary.of(error[first:]) for name, error in errors.items()}


def what_is_missing(score: RunScore) -> str | None:
    """Why a score's table would have holes, None where all its numbers are there."""
    if score.settled >= len(score.t):
        return (
            f"the approach phase never ended: within {score.t[-1] - score.t[0]:.1f} s the fish was never within {NEAR_PATH:g} m "
            f"and {NEAR_HEADING:g} rad of its path and {100 * NEAR_SPEED:.0f} % of its speed at once (nearest to the path: "
            f"{np.abs(score.cross_track).min():.2f} m); the error without the approach is not defined"
        )
    for with_approach in (False, True):
        for name, size in score.summaries(with_approach=with_approach).items():
            if not np.isfinite([size.rmse, size.p95, size.maximum]).all():
                return f"the {name.split(',')[0]} error is no number"
    return None


def score_trial(trial: Trial) -> RunScore:
    """Score a recording: against the simulator's truth where recorded, else the robot's own estimate.

    Raises:
        UserError: path, speed or odometry is missing, or no sample of it can be used.
    """
    for recorded in (trial.truth, trial.odometry):
        if recorded is not None and not np.any(recorded.flags == 0):
            raise UserError(
                f"{trial.name}: none of {len(recorded)} samples of {recorded.topic} can be used (`robofish inspect` says why); "
                "nothing to score"
            )
    trial = trial.clean()
    motion, source = (
        (trial.truth, "truth") if trial.truth is not None else (trial.odometry, "estimate")
    )
    if motion is None:
        raise UserError(
            f"{trial.name}: neither sim/odometry nor odometry/filtered was recorded; nothing to score"
        )
    if not trial.reference_paths:
        raise UserError(f"{trial.name}: reference/path was not recorded; nothing to score against")
    if trial.reference_speed is None:
        raise UserError(f"{trial.name}: reference/speed was not recorded; nothing to score against")
    given = _last_path(trial)
    speeds = trial.reference_speed.speed
    if not np.any(speeds > 0.0):
        raise UserError(f"{trial.name}: the commanded speed was never above 0; nothing to score")
    last = int(np.flatnonzero(speeds > 0.0)[-1])
    # 0 is said at the end of the path; a path that ends where it begins (B) does not say so itself
    said = trial.reference_speed.t[last + 1 :]
    end = float(min(said[said > given.t], default=np.inf))
    try:
        path = path_from_points(given.points)
    except PathError as error:
        raise UserError(
            f"{trial.name}: reference/path cannot be scored against: {error}"
        ) from error
    return score_motion(
        motion, path, commanded_speed(trial.reference_speed, motion.t), given.t, source, end
    )


def commanded_speed(said: ReferenceSpeed, t: Array) -> Array:
    """The speed in force at each of the times: the last one said, before the first the first; one at least is above 0.

    A 0 ends a path and is no speed to swim at: from there on the next one counts, after the last the last.
    """
    positive = np.flatnonzero(said.speed > 0.0)
    in_force = np.maximum(np.searchsorted(said.t, t, side="right") - 1, 0)
    held = np.minimum(np.searchsorted(positive, in_force), len(positive) - 1)
    return np.asarray(said.speed[positive[held]], dtype=float)


def _last_path(trial: Trial) -> RecordedPath:
    """The last path, since it was first given: a planner that is started again says it again."""
    *earlier, last = trial.reference_paths
    for path in reversed(earlier):
        if not np.array_equal(path.points, last.points):
            break
        last = path
    return last


def path_from_points(points: Array) -> ReferencePath:
    """The path of a reference/path message, closed if its ends meet.

    Raises:
        PathError: fewer than two points, or values that are not finite.
    """
    if len(points) < 2:
        raise PathError(f"got {len(points)} points; expected at least two")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    closed = bool(np.linalg.norm(points[-1] - points[0]) < CLOSED_GAP * np.median(steps))
    return ReferencePath.from_points(points, name="recorded", closed=closed)


def score_motion(
    motion: Odometry,
    path: ReferencePath,
    reference_speed: float | Array,
    start: float,
    source: str,
    end: float = np.inf,
) -> RunScore:
    """Errors of a motion on a path followed in order, from time `start` [s] to `end`, the path's end or the motion's.

    reference_speed: one for all samples of the motion, or of each [m/s].
    """
    said = bool(len(motion)) and bool(motion.t[-1] >= end)
    within = (motion.t >= start) & (motion.t <= end)
    wanted, motion = np.broadcast_to(reference_speed, motion.t.shape)[within], motion.take(within)
    if not len(motion):
        raise UserError("no pose was recorded after the path was given; nothing to score")
    tracker = PathTracker(path)
    if path.closed:
        tracker.reset(tracker.nearest(motion.pose[0, :2]))
    points = [tracker.update(position) for position in motion.pose[:, :2]]
    n = next((k + 1 for k, point in enumerate(points) if point.finished), len(points))
    motion, points, wanted = motion.take(np.arange(n)), points[:n], wanted[:n]
    chi = np.array([point.heading for point in points])
    progress = np.array([point.progress for point in points])
    cross_track = np.array([point.cross_track_error for point in points])
    psi = np.unwrap(motion.psi)
    heading = _wrap(chi - stroke_mean(motion.t, psi))
    speed_error = wanted - motion.u
    return RunScore(
        source=source,
        path=path,
        reference_speed=wanted,
        t=motion.t,
        position=motion.pose[:, :2],
        speed=motion.u,
        progress=progress,
        cross_track=cross_track,
        heading=heading,
        head_angle=_wrap(chi - psi),
        speed_error=speed_error,
        settled=first_settled(motion.t, progress, cross_track, heading, speed_error, wanted),
        finished=points[-1].finished or said,
    )


def _wrap(angle: Array) -> Array:
    return np.asarray(np.angle(np.exp(1j * angle)))


def error_table(score: RunScore) -> Table:
    """RMSE, 95th percentile and maximum of every error, with and without the approach phase."""
    whole, settled = score.summaries(with_approach=True), score.summaries(with_approach=False)
    rows = [[name, *_cells(settled[name]), *_cells(whole[name])] for name in whole]
    header = ["error", "RMSE", "95 %", "max", "RMSE *", "95 % *", "max *"]
    approach = "never ended" if np.isnan(score.approach_s) else f"took {score.approach_s:.1f} s"
    note = f"Without the approach phase, which {approach}; * with it. Heading: mean over a stroke of the tail."
    if not (score.finished or score.path.closed):
        note += (
            f" The run ended at {score.progress[-1]:.2f} m of a path of {score.path.length:.2f} m."
        )
    return Table("Tracking errors", header, rows, note)


def _cells(summary: Summary) -> list[str]:
    sizes = (summary.rmse, summary.p95, summary.maximum)
    return [f"{value:.4f}" if np.isfinite(value) else "-" for value in sizes]
