# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Trials on the filter's grid: every 10 ms a command, an IMU sample, an encoder sample and perhaps a camera pose.

All trials of a data set stand side by side, padded to the longest; `steps` says where a trial ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_bag.trial import Commands, Imu, Trial
from fish_sim.model import DT
from fish_sysid.dataset.commands import (
    LostCommandsError,
    commands_on_grid,
    driven,
    not_followed,
)
from fish_sysid.dataset.grid import (
    FEWEST_POSES,
    apart,
    heading,
    level,
    on_grid,
    starts_at_rest,
)

Array = NDArray[np.float64]

LONGEST_UNKNOWN = 1.0  # s after the first command without camera and gyro: the heading is unknown
STEPS_AT_ONCE = 8000  # grid points of a pass that keeps its history or has many derivatives: memory


class ExperimentError(ValueError):
    """The recordings do not allow what was asked; the message says what is missing."""


@dataclass(frozen=True)
class Frames:
    """Camera poses of one trial in order of stamps."""

    t: Array  # (F,) s from the trial's grid start
    pose: Array  # (F, 3) x, y [m], psi [rad] unwrapped, pool frame


@dataclass(frozen=True)
class Headings:
    """Headings of one trial by the IMU's own orientation, in order of stamps: an unknown constant is added to them."""

    t: Array  # (Q,) s from the trial's grid start
    psi: Array  # (Q,) rad, unwrapped


NO_HEADINGS = Headings(np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Experiment:
    """Trials on one grid of 10 ms; NaN where a sensor says nothing."""

    names: tuple[str, ...]  # M trials
    steps: NDArray[np.int64]  # (M,) grid points with data
    commands: Array  # (T, M, 2) rotor speed [rad/s], rudder [rad]
    gyro: Array  # (T, M) rad/s, about the vertical
    accel: Array  # (T, M, 2) m/s^2, level forward and left
    encoder: Array  # (T, M) rad/s
    frames: tuple[Frames, ...]
    start_at_rest: bool  # fish and rotor still, rudder centred, at the first grid point
    headings: tuple[Headings, ...] = ()  # by the IMU's orientation; empty: of no trial

    def heading_of(self, m: int) -> Headings:
        """Headings of trial m by the IMU's orientation; none where it gives no orientation."""
        return self.headings[m] if self.headings else NO_HEADINGS

    def select(self, which: Sequence[int]) -> Experiment:
        """Some of the trials."""
        index = np.array(which, dtype=int)
        longest = int(self.steps[index].max())
        arrays = {
            k: getattr(self, k)[:longest, index] for k in ("commands", "gyro", "accel", "encoder")
        }
        names, frames = tuple(self.names[i] for i in which), tuple(self.frames[i] for i in which)
        headings = tuple(self.headings[i] for i in which) if self.headings else ()
        return replace(
            self, names=names, frames=frames, headings=headings, steps=self.steps[index], **arrays
        )

    def rest_of(self, trial: int, first: int) -> Experiment:
        """One trial from a grid point on, with the fish in motion."""
        one, start = self.select([trial]), first * DT
        arrays = {k: getattr(one, k)[first:] for k in ("commands", "gyro", "accel", "encoder")}
        seen = one.frames[0].t >= start
        frames = (Frames(one.frames[0].t[seen] - start, one.frames[0].pose[seen]),)
        turned = one.heading_of(0)
        felt = turned.t >= start
        headings = (Headings(turned.t[felt] - start, turned.psi[felt]),)
        return replace(
            one,
            steps=one.steps - first,
            frames=frames,
            headings=headings,
            start_at_rest=False,
            **arrays,
        )

    def batches(self) -> list[list[int]]:
        """Indices of trials in groups of at most STEPS_AT_ONCE grid points, one trial at least."""
        count, trials = max(1, STEPS_AT_ONCE // self.length), len(self.names)
        return [list(range(first, min(first + count, trials))) for first in range(0, trials, count)]

    @property
    def length(self) -> int:
        return len(self.commands)

    @property
    def given_commands(self) -> Array:
        """(N, 2) commands of all trials, one trial after the other, without what pads the shorter ones."""
        return np.concatenate([self.commands[:steps, m] for m, steps in enumerate(self.steps)])


def build_experiment(trials: Sequence[Trial], start_at_rest: bool | None = None) -> Experiment:
    """Put trials on the grid of their commands.

    start_at_rest None: as `starts_at_rest` finds for all trials together.
    Measurements before the first command or after the last one are left out: the rotor's speed is unknown then.
    Raises ExperimentError without a trial, and for one without commands or with too few camera poses, with a gap in the commands
    that is too long, or in which the fish may have turned too far before a sensor shows its heading.
    """
    if not trials:
        raise ExperimentError("no trial with data; expected at least one")
    gridded = [_grid(trial.clean()) for trial in trials]
    steps = np.array([len(g["commands"]) for g in gridded])
    longest = int(steps.max())

    def stack(key: str) -> Array:
        filler = 0.0 if key == "commands" else np.nan
        shape = (longest, len(gridded), *gridded[0][key].shape[1:])
        out = np.full(shape, filler)
        for i, g in enumerate(gridded):
            out[: steps[i], i] = g[key]
        return out

    arrays = {key: stack(key) for key in ("commands", "gyro", "accel", "encoder")}
    rest = start_at_rest
    if rest is None:
        sensors = [
            [g[key] for key in ("gyro", "accel", "encoder", "frame_t", "frame_pose")]
            for g in gridded
        ]
        rest = all(starts_at_rest(*own) for own in sensors)
    frames = tuple(Frames(g["frame_t"], g["frame_pose"]) for g in gridded)
    headings = tuple(Headings(g["heading_t"], g["heading"]) for g in gridded)
    return Experiment(
        tuple(t.name for t in trials),
        steps,
        **arrays,
        frames=frames,
        start_at_rest=rest,
        headings=headings,
    )


def _grid(trial: Trial) -> dict[str, Array]:
    if trial.commands is None:
        raise ExperimentError(f"{trial.name}: no joint_command; the inputs of the fish are needed")
    c, imu, encoder = trial.commands, trial.imu, trial.encoder
    start, end = c.t[0], c.t[-1] + DT
    t = _times(c)
    frames = _seen(trial, start, end)
    nothing = np.full(len(t), np.nan)
    gyro, accel = nothing, np.full((len(t), 2), np.nan)
    headings = NO_HEADINGS
    if imu is not None:
        headings = _headings(imu, start, end)
        gyro, accel = (on_grid(imu.t, felt, t, DT) for felt in level(imu))
    _check_heading(trial.name, frames, gyro)
    measured = nothing if encoder is None else on_grid(encoder.t, encoder.speed, t, DT)
    commands, measured = _commands(trial.name, c, t, measured)
    commands[:, 0], measured = driven(commands[:, 0], measured)
    return {
        "commands": commands,
        "gyro": gyro,
        "accel": accel,
        "encoder": measured,
        "frame_t": frames.t,
        "frame_pose": frames.pose,
        "heading_t": headings.t,
        "heading": headings.psi,
    }


def rotor_not_followed(trial: Trial) -> bool:
    """Whether the rotor's measured speed drives the model, as commands come irregularly and it moves at other times."""
    clean = trial.clean()
    c, encoder = clean.commands, clean.encoder
    if c is None or encoder is None:
        return False
    t = _times(c)
    given = np.column_stack([c.rotor_speed, c.rudder])
    return not_followed(c.t, given, t, on_grid(encoder.t, encoder.speed, t, DT))


def _times(c: Commands) -> Array:
    """The grid of a trial's commands, in its stamps."""
    count = int(np.floor((c.t[-1] + DT - c.t[0]) / DT + 1e-6)) + 1
    return np.asarray(c.t[0] + DT * np.arange(count))


def _headings(imu: Imu, start: float, end: float) -> Headings:
    """What the IMU's orientation says while commands came."""
    t, psi = heading(imu)
    seen = (t >= start - 0.5 * DT) & (t <= end)
    return Headings(t[seen] - start, psi[seen])


def _seen(trial: Trial, start: float, end: float) -> Frames:
    """The camera's poses while commands came; of a camera that is faster than the grid those that each have a grid point."""
    camera = trial.camera
    if camera is None:
        raise ExperimentError(f"{trial.name}: no camera/pose; at least three poses are needed")
    seen = (camera.t >= start - 0.5 * DT) & (camera.t <= end)
    if seen.sum() < FEWEST_POSES:
        raise ExperimentError(
            f"{trial.name}: {seen.sum()} of {len(camera)} camera poses lie between the first and the last command; "
            "at least three are needed"
        )
    kept = apart(camera.t[seen], DT)
    pose = np.column_stack([camera.x, camera.y, np.unwrap(camera.psi)])
    return Frames((camera.t[seen] - start)[kept], pose[seen][kept])


def _check_heading(name: str, frames: Frames, gyro: Array) -> None:
    """Refuse a trial in which the fish may have turned too far before a sensor shows its heading."""
    first = float(frames.t[0])
    if DT * np.isnan(gyro[: max(round(first / DT), 0)]).sum() > LONGEST_UNKNOWN:
        raise ExperimentError(
            f"{name}: the first camera pose comes {first:.1f} s after the first command and no gyro tells how the fish turned "
            f"until then; expected it within {LONGEST_UNKNOWN:g} s; start the camera before the commands"
        )


def _commands(name: str, c: Commands, t: Array, encoder: Array) -> tuple[Array, Array]:
    """`commands_on_grid` of a trial; raises ExperimentError where a gap is too long."""
    try:
        return commands_on_grid(c.t, np.column_stack([c.rotor_speed, c.rudder]), t, encoder)
    except LostCommandsError as error:
        raise ExperimentError(f"{name}: {error}") from error


def shorten(experiment: Experiment, steps: int) -> Experiment:
    """The first `steps` grid points of every trial; all its frames, as the first may come after them."""
    arrays = {k: getattr(experiment, k)[:steps] for k in ("commands", "gyro", "accel", "encoder")}
    felt = [h.t < DT * (steps - 0.5) for h in experiment.headings]
    headings = tuple(
        Headings(h.t[f], h.psi[f]) for h, f in zip(experiment.headings, felt, strict=True)
    )
    shorter = np.minimum(experiment.steps, steps)
    return replace(experiment, steps=shorter, headings=headings, **arrays)


def joined(days: Sequence[Experiment]) -> Experiment:
    """All trials of these experiments; the names of those after the first day get its number where they are taken."""
    if len(days) == 1:
        return days[0]
    longest = max(day.length for day in days)
    arrays = {}
    for key in ("commands", "gyro", "accel", "encoder"):
        filler = 0.0 if key == "commands" else np.nan
        padded = [
            np.concatenate([a, np.full((longest - len(a), *a.shape[1:]), filler)])
            for a in (getattr(day, key) for day in days)
        ]
        arrays[key] = np.concatenate(padded, axis=1)
    names: list[str] = []
    for number, day in enumerate(days, 1):
        names += [f"{name} of day {number}" if name in names else name for name in day.names]
    return replace(
        days[0],
        names=tuple(names),
        steps=np.concatenate([day.steps for day in days]),
        frames=tuple(f for day in days for f in day.frames),
        headings=tuple(
            h for day in days for h in (day.headings or (NO_HEADINGS,) * len(day.names))
        ),
        start_at_rest=all(day.start_at_rest for day in days),
        **arrays,
    )
