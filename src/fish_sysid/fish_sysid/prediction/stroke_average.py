# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pose and body velocity averaged over strokes: what a prediction and a recording are compared in.

The fish swings with every stroke (0.5 s at 2 Hz). A local straight line through the poses of one second, weighted with a
Hann window, has the swing averaged out: of a 2 Hz motion nothing is left in the value and 6 % in the slope. The same is
done to measured and to predicted poses, so that it favours neither.

A target of a fit to predictions is the stroke mean of the camera's poses `h` seconds after a start point. It is linear in the
predicted poses, so that one product serves all. Its errors, scaled by what counts as one,

    e = (x / s_p(h), y / s_p(h), psi / s_psi(h), u / s_u),   s_p = a + b h
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.grid import in_base_link

Array = NDArray[np.float64]
Index = NDArray[np.int64]

HALF_WINDOW = 0.5  # s; a Hann window of twice this is as wide as a stroke
LEAST_FRAMES = 0.6  # share of the frames that a window should hold
LARGEST_SHIFT = 0.1  # s, between a window's centre and the mean time of its frames
# start point, trial, grid points of the frames, weights of mean and rate, what was measured, what counts as one
Row = tuple[int, int, Array, Array, Array, Array, Array]
HORIZONS = (0.5, 1.0, 2.0, 3.5, 5.0)  # s
POSITION = (0.008, 0.02)  # m, and m per s of horizon: what counts as one
HEADING = (0.06, 0.04)  # rad, and rad per s
SPEED = 0.02  # m/s


@dataclass(frozen=True)
class StrokeMean:
    """Weights of poses at F frames for C centres; rows of NaN where the frames do not cover the window."""

    value: Array  # (C, F)
    slope: Array  # (C, F) 1/s

    def __call__(self, pose: Array) -> Array:
        """(C, ..., 6) x, y, psi [m, m, rad] and u, v, r [m/s, m/s, rad/s] of poses (F, ..., 3), psi unwrapped."""
        mean, rate = np.tensordot(self.value, pose, 1), np.tensordot(self.slope, pose, 1)
        u, v = in_base_link(rate[..., 0], rate[..., 1], mean[..., 2])
        return np.concatenate([mean, np.stack([u, v, rate[..., 2]], axis=-1)], axis=-1)


def stroke_mean(frames: Array, centres: Array) -> StrokeMean:
    """Weights for frames at times (F,) and centres (C,) [s]: weighted least squares of a line in each window."""
    tau = frames[None, :] - centres[:, None]
    w = np.where(np.abs(tau) < HALF_WINDOW, np.cos(0.5 * np.pi * tau / HALF_WINDOW) ** 2, 0.0)
    period = np.median(np.diff(frames)) if len(frames) > 1 else np.inf
    total = np.maximum(w.sum(1), 1e-12)
    shift = (w * tau).sum(1) / total
    spread = np.maximum((w * (tau - shift[:, None]) ** 2).sum(1), 1e-12)
    slope = w * (tau - shift[:, None]) / spread[:, None]
    value = w / total[:, None] - shift[:, None] * slope
    covered = (w > 0).sum(1) >= max(4.0, LEAST_FRAMES * 2.0 * HALF_WINDOW / period)
    covered &= np.abs(shift) < LARGEST_SHIFT
    return StrokeMean(
        np.where(covered[:, None], value, np.nan), np.where(covered[:, None], slope, np.nan)
    )


@dataclass(frozen=True)
class Targets:
    """R targets; F is the most frames in a window, rows padded with weights of 0."""

    start: Index  # (R,) row of the start points
    trial: Index  # (R,)
    position: Array  # (R, F) grid points after the start, of the frames
    value: Array  # (R, F) weights of the mean
    slope: Array  # (R, F) 1/s, weights of the rate
    measured: Array  # (R, 4) x, y [m], psi [rad], u [m/s]
    scale: Array  # (R, 4)

    @property
    def horizon(self) -> Array:
        """Seconds after the start point (R,)."""
        return np.round((self.scale[:, 0] - POSITION[0]) / POSITION[1], 6)

    def __len__(self) -> int:
        return len(self.start)

    def errors(self, pose: Array, late: float, offset: float) -> Array:
        """(R, ..., 4) scaled errors of poses (T, S, ..., 3) of the point that the camera follows.

        Images are `late` [s], headings seen `offset` [rad] too large.
        """
        position = np.clip(self.position - late / DT, 0.0, len(pose) - 1.001)
        low = position.astype(int)
        share = (position - low).reshape(*low.shape, *([1] * (pose.ndim - 2)))
        rows = self.start[:, None]
        below, above = pose[low, rows], pose[low + 1, rows]
        q = below + share * (above - below)
        mean, rate = (np.einsum("rf,rf...->r...", w, q) for w in (self.value, self.slope))
        u = rate[..., 0] * np.cos(mean[..., 2]) + rate[..., 1] * np.sin(mean[..., 2])
        shape = (len(self), *([1] * (pose.ndim - 3)), self.measured.shape[1])
        e = np.concatenate([mean, u[..., None]], axis=-1) - self.measured.reshape(shape)
        e[..., 2] = (e[..., 2] + offset + np.pi) % (2.0 * np.pi) - np.pi
        return e / self.scale.reshape(shape)


def targets_of(
    experiment: Experiment, starts: Index, horizons: tuple[float, ...] = HORIZONS
) -> Targets:
    """Targets of start points (S, 2) of trial and grid point, where the camera covers them."""
    rows: list[Row] = []
    for m in np.unique(starts[:, 0]).tolist():
        frames, end = experiment.frames[m], (int(experiment.steps[m]) - 2) * DT
        own = np.flatnonzero(starts[:, 0] == m)
        for h in horizons:
            centres = starts[own, 1] * DT + h
            mean = stroke_mean(frames.t, centres)
            for i, row in enumerate(own.tolist()):
                near = np.flatnonzero(np.abs(frames.t - centres[i]) < HALF_WINDOW)
                if len(near) < 2 or frames.t[near[-1]] > end:
                    continue
                value, slope = mean.value[i, near], mean.slope[i, near]
                if not np.isfinite(value).all() or frames.t[near[0]] < starts[row, 1] * DT:
                    continue
                pose = frames.pose[near]
                seen, rate = value @ pose, slope @ pose
                u = rate[0] * np.cos(seen[2]) + rate[1] * np.sin(seen[2])
                p, psi = (a + b * h for a, b in (POSITION, HEADING))
                at = frames.t[near] / DT - starts[row, 1]
                size = np.array([p, p, psi, SPEED])
                measured = np.append(seen, u)
                rows.append((row, m, at, value, slope, measured, size))
    return _padded(rows)


def _padded(rows: list[Row]) -> Targets:
    most = max((len(row[2]) for row in rows), default=0)

    def wide(i: int) -> Array:
        out = np.zeros((len(rows), most))
        for r, row in enumerate(rows):
            values = np.atleast_1d(row[i])
            out[r, : len(values)] = values
        return out

    def column(i: int) -> Index:
        return np.array([row[i] for row in rows], dtype=np.int64)

    measured, scale = (np.array([row[i] for row in rows]).reshape(-1, 4) for i in (5, 6))
    return Targets(column(0), column(1), wide(2), wide(3), wide(4), measured, scale)
