# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera's clock and the point that it follows, both taken out of recordings before anything is fitted.

The heading that the camera shows at t is the fish's at t - d, whose changes the gyro measures:

    d = argmin of sum over windows | psi_camera(t) - integral of r up to (t - d), less a straight line |^2

The straight line takes the gyro's bias and the unknown start away; no model of the fish is needed. The likelihood of a model
has many optima in d, one per stroke, as soon as d is more than a quarter of one: this finds the right one. Poses of the
point that the camera follows become those of the head's centre of mass.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Frames

Array = NDArray[np.float64]

WINDOW = 4.0  # s, of poses that are compared
LEAST_FRAMES = 12  # in a window
LARGEST = 1.0  # s, delay that is looked for
STEP = 0.01  # s
DELAYS = np.arange(0.0, LARGEST + 0.5 * STEP, STEP)
CLIP = 0.5  # rad; windows in which the markers were swapped count no more than this
CLEAR = 0.7  # rms at the best delay over rms at none, below which a delay is stated
HOLE = 0.25  # s between gyro samples, beyond which nobody knows how the fish turned
SMALLEST = 0.03  # s, about a frame; below it the filter's own parameter finds it
MARKER, AHEAD = "camera_marker", "ahead"


@dataclass(frozen=True)
class Alignment:
    """Camera and gyro laid over each other."""

    delay: float  # s, how much older than its stamp an image is; 0 where the data do not clearly say so
    rms: float  # rad, heading of the camera less that of the gyro at this delay
    rms_undelayed: float  # rad, the same without a delay
    # (M, D) rad^2, mean squares at each of DELAYS of the trials that tell
    squares: Array = field(default_factory=lambda: np.zeros((0, len(DELAYS))))


def align(experiment: Experiment) -> Alignment:
    """The delay common to all trials; 0 with rms NaN where no trial has a gyro and enough poses."""
    squares, count = misfits(experiment)
    if not count.any():
        return Alignment(0.0, np.nan, np.nan)
    rms = np.sqrt(np.nansum(squares * count[:, None], axis=0) / count.sum())
    best = int(rms.argmin())
    clear = rms[best] < CLEAR * rms[0] and DELAYS[best] >= SMALLEST and best < len(DELAYS) - 1
    best = best if clear else 0
    return Alignment(float(DELAYS[best]), float(rms[best]), float(rms[0]), squares[count > 0])


def misfits(experiment: Experiment) -> tuple[Array, NDArray[np.int64]]:
    """Mean squares (M, D) [rad^2] at each of DELAYS, NaN without a gyro, and the number of windows (M,) behind them."""
    squares = np.full((len(experiment.names), len(DELAYS)), np.nan)
    count = np.zeros(len(squares), dtype=np.int64)
    for m, frames in enumerate(experiment.frames):
        turned = _turned(experiment, m)
        picks = [] if turned is None else _windows(frames, turned)
        if turned is None or not picks:
            continue
        rows = [_misfit(frames.t[pick], frames.pose[pick, 2], turned, DELAYS) for pick in picks]
        squares[m], count[m] = np.mean(rows, axis=0), len(rows)
    return squares, count


def _turned(experiment: Experiment, m: int) -> Array | None:
    """Integral of the gyro (steps,) [rad] up to half a step after each grid point of trial m; None without a gyro.

    NaN where the gyro says nothing: before its first sample, after its last one and in holes.
    """
    gyro = experiment.gyro[: experiment.steps[m], m]
    known = np.flatnonzero(np.isfinite(gyro))
    if len(known) < 2:
        return None
    grid = np.arange(len(gyro))
    angle: Array = DT * np.cumsum(np.interp(grid, known, gyro[known]))
    after = np.searchsorted(known, grid)
    before = known[np.maximum(np.searchsorted(known, grid, side="right") - 1, 0)]
    gap = known[np.minimum(after, len(known) - 1)] - before
    angle[(grid < known[0]) | (grid > known[-1]) | (gap * DT > HOLE)] = np.nan
    return angle


def _windows(frames: Frames, turned: Array) -> list[NDArray[np.int64]]:
    """Indices of the frames of each window that starts late enough for every delay and in which the gyro never pauses."""
    out = []
    for start in np.arange(LARGEST, len(turned) * DT - WINDOW, WINDOW):
        pick = np.flatnonzero((frames.t >= start) & (frames.t < start + WINDOW))
        first, last = round((start - LARGEST) / DT), round((start + WINDOW) / DT)
        if len(pick) >= LEAST_FRAMES and np.isfinite(turned[first : last + 1]).all():
            out.append(pick)
    return out


def _misfit(t: Array, heading: Array, turned: Array, delays: Array) -> Array:
    """Mean squares [rad^2] of the differences less their straight lines, one per delay."""
    taken = t[:, None] - delays
    difference = heading[:, None] - np.interp(taken / DT, np.arange(len(turned)) + 0.5, turned)
    line = np.column_stack([np.ones_like(t), t - t.mean()])
    rest = difference - line @ np.linalg.lstsq(line, difference, rcond=None)[0]
    return np.asarray(np.mean(np.minimum(rest**2, CLIP**2), axis=0))


def fine_delay(experiment: Experiment) -> tuple[float, float]:
    """Delay [s] between the grid's delays, by a parabola through the least mean squares, and its jackknife error over trials.

    NaN where fewer than two trials have a gyro and enough poses, and where the parabola is lowest more than half a step beyond
    DELAYS: there it is extrapolated.
    """
    squares, count = misfits(experiment)
    used = squares[count > 0]
    if len(used) < 2:
        return np.nan, np.nan
    left_out = np.array([_lowest(np.delete(used, m, 0).mean(axis=0)) for m in range(len(used))])
    spread = float(np.sqrt((len(used) - 1) / len(used) * ((left_out - left_out.mean()) ** 2).sum()))
    delay, beyond = _lowest(used.mean(axis=0)), 0.5 * STEP
    tried = DELAYS[0] - beyond <= delay <= DELAYS[-1] + beyond
    return (delay, spread) if tried else (np.nan, np.nan)


def _lowest(squares: Array) -> float:
    """Where mean squares (D,) at DELAYS are least, by a parabola through the lowest three; NaN where they only fall to an end."""
    least = int(squares.argmin())
    best = int(np.clip(least, 1, len(squares) - 2))
    before, at, after = squares[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    if bend <= 0.0:
        return float(DELAYS[best]) if best == least else np.nan
    return float(DELAYS[best] + 0.5 * STEP * (before - after) / bend)


def gyro_windows(experiment: Experiment, m: int) -> Array:
    """How the camera's heading differs from the gyro's angle in each window of trial m.

    Returns:
        (W, 4) in rad: projection of the difference, less its straight line, on the unit gyro rate, norm of that rate times
        one second, projection on the unit gyro angle, norm of that angle; an image older by d [s] adds -d times the second
        to the first, a gyro that reads (1 + e) times the rate adds -e times the fourth to the third.

    """
    turned = _turned(experiment, m)
    if turned is None:
        return np.zeros((0, 4))
    frames, grid = experiment.frames[m], np.arange(len(turned)) + 0.5
    rate, rows = np.gradient(turned, DT), []
    for pick in _windows(frames, turned):
        t = frames.t[pick]
        line = np.column_stack([np.ones_like(t), t - t.mean()])
        angle, speed = (np.interp(t / DT, grid, x) for x in (turned, rate))
        columns = np.column_stack([frames.pose[pick, 2] - angle, speed, angle])
        rest = columns - line @ np.linalg.lstsq(line, columns, rcond=None)[0]
        lengths = np.maximum(np.linalg.norm(rest, axis=0), 1e-9)
        by_rate, by_angle = rest[:, 0] @ rest[:, 1:] / lengths[1:]
        rows.append([by_rate, lengths[1], by_angle, lengths[2]])
    return np.array(rows).reshape(-1, 4)


def moved_back(experiment: Experiment, delay: float) -> Experiment:
    """The experiment with every image at the moment it was taken; those taken before the first command are left out."""
    frames = tuple(_moved(f, delay) for f in experiment.frames)
    return replace(experiment, frames=frames)


def _moved(frames: Frames, delay: float) -> Frames:
    keep = frames.t >= delay
    return Frames(frames.t[keep] - delay, frames.pose[keep])


def ahead_of(robot: Robot) -> float:
    """How far the point that the camera follows lies ahead of the head's centre of mass [m]."""
    return float(robot.sensors.get(MARKER, {}).get(AHEAD, 0.0))


def with_marker(robot: Robot, ahead: float) -> Robot:
    """The robot whose camera follows a point `ahead` [m] of the one that it followed; without the entry where that is 0."""
    place = ahead_of(robot) + ahead
    sensors = {name: values for name, values in robot.sensors.items() if name != MARKER}
    return replace(robot, sensors=sensors | ({MARKER: {AHEAD: place}} if place else {}))


def at_centre_of_mass(experiment: Experiment, ahead: float) -> Experiment:
    """The experiment as a camera would see it that follows the centre of mass, `ahead` [m] behind the point it follows."""
    if ahead == 0.0:
        return experiment
    frames = tuple(Frames(f.t, forward(f.pose, -ahead)) for f in experiment.frames)
    return replace(experiment, frames=frames)


def forward(pose: Array, ahead: float | Array) -> Array:
    """Poses (..., 3) of a point `ahead` [m] of another one on the same head; (...) or one for all."""
    moved = pose.copy()
    moved[..., 0] += ahead * np.cos(pose[..., 2])
    moved[..., 1] += ahead * np.sin(pose[..., 2])
    return moved
