# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Windows of raw measurements on which a model is shot, their residuals and the slopes of these.

A window holds camera poses and the IMU's headings between two grid points, as many steps in every trial, so that all windows are
simulated side by side. Of one that starts with the motion x and whose IMU counts headings from an unknown zero b:

    e = ((p(t - d_c) + a e(psi) - p_camera) / s_p,  (psi(t - d_c) + h - psi_camera) / s_psi,
         (psi(t - d_i) + b - psi_imu) / s_imu)

e(psi) = (cos psi, sin psi); a: how far the point that the camera follows lies ahead of the head's centre of mass [m]; h: the
camera's heading offset [rad]; d_c, d_i: ages of images and IMU samples beyond what was taken out before [s]. d_i counts from d_c,
so that camera and IMU, which agree about when the fish turns, move together against the commands. The IMU's integrated
orientation is used, not its gyro: the rate samples of real ones do not integrate to the turn that was made.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.camera import forward
from fish_sysid.dataset.experiment import Experiment

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MARGIN = 0.05  # s at both ends of a window without samples: clocks may move by as much
FEWEST_FRAMES = 4  # that a start state needs
LEAST_SHARE = 0.5  # of the frames that the camera's usual rate gives
# parameters of the sensors, and what counts as one: s, s (beyond the camera's), rad, m
SENSORS = (
    "camera_latency.delay",
    "imu_latency.delay",
    "camera_heading_offset.offset",
    "camera_marker.ahead",
)
SENSOR_SCALE = np.array([0.02, 0.02, 0.03, 0.02])


@dataclass(frozen=True)
class Samples:
    """Measurements of one sensor in all windows, window by window."""

    window: Index  # (F,)
    t: Array  # (F,) s from the window's start
    value: Array  # (F, ...)


@dataclass(frozen=True)
class Windows:
    """W windows of `steps` steps."""

    trial: Index  # (W,)
    start: Index  # (W,) grid point
    steps: int
    commands: Array  # (steps, W, 2) rotor speed [rad/s], rudder [rad]
    poses: Samples  # value (F, 3) x, y [m], psi [rad]
    headings: Samples  # value (Q,) rad, an unknown constant per window is added

    def __len__(self) -> int:
        return len(self.trial)


def regular_starts(experiment: Experiment, length: float, every: float, first: float) -> Index:
    """(W, 2) trial and grid point of windows of `length` [s], the first at `first` [s], that end within their trial."""
    rows = [
        (m, round(t / DT))
        for m, steps in enumerate(experiment.steps.tolist())
        for t in np.arange(first, (steps - 2) * DT - length, every).tolist()
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 2)


def cut(experiment: Experiment, starts: Index, length: float, late: float = MARGIN) -> Windows:
    """Windows of `length` [s] from starts (W, 2); those that the camera hardly covers are left out.

    late: s at the end without samples.
    """
    kept: list[tuple[int, int]] = []
    frames, headings = [], []
    for m, k in starts.tolist():
        seen, felt = experiment.frames[m], experiment.heading_of(m)
        inside = _inside(seen.t, k * DT, length, late)
        if len(inside) < max(FEWEST_FRAMES, LEAST_SHARE * _usual_count(seen.t, length)):
            continue
        turned = _inside(felt.t, k * DT, length, late)
        w = len(kept)
        frames.append((w, seen.t[inside] - k * DT, seen.pose[inside]))
        headings.append((w, felt.t[turned] - k * DT, felt.psi[turned]))
        kept.append((m, k))
    trial, start = np.array(kept, dtype=np.int64).reshape(-1, 2).T
    steps = round(length / DT)
    rows = np.minimum(start + np.arange(steps)[:, None], experiment.steps[trial] - 1)
    return Windows(
        trial,
        start,
        steps,
        experiment.commands[rows, trial],
        _joined(frames, (0, 3)),
        _joined(headings, (0,)),
    )


def _inside(t: Array, start: float, length: float, late: float) -> Index:
    return np.flatnonzero((t >= start + MARGIN) & (t < start + length - late))


def _usual_count(t: Array, length: float) -> float:
    """Frames that a window of this length has at the camera's usual rate."""
    return (length - 2.0 * MARGIN) / float(np.median(np.diff(t))) if len(t) > 1 else np.inf


def _joined(parts: list[tuple[int, Array, Array]], empty: tuple[int, ...]) -> Samples:
    if not parts:
        return Samples(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(empty))
    window = np.repeat([w for w, _, _ in parts], [len(t) for _, t, _ in parts])
    t, value = (np.concatenate([part[i] for part in parts]) for i in (1, 2))
    return Samples(window.astype(np.int64), t, value)


def ahead_in(sensors: Array) -> float:
    """How far the point that the camera follows lies ahead [m], of sensors (4,) in units of SENSOR_SCALE."""
    return float(sensors[3] * SENSOR_SCALE[3])


LOST = 200.0  # a scaled error of motion that diverged
STEEPEST = 3e4  # slope beyond which the motion is unstable and its slope says nothing


@dataclass(frozen=True)
class Scale:
    """What counts as one: noise of the sensors and what a wrong model misses within a window."""

    position: float = 0.004  # m
    heading: float = 0.03  # rad, by the camera
    orientation: float = 0.015  # rad, by the IMU
    # s before a window's end at which a sample counts half: an old one says less of the end
    fading: float = np.inf


@dataclass(frozen=True)
class Residuals:
    """R scaled errors with slopes; Jz along theta and sensors, Jx along start motion and heading zero; (R, 0) without."""

    window: NDArray[np.int64]  # (R,)
    e: Array  # (R,)
    Jz: Array  # (R, P)
    Jx: Array  # (R, NX + 1)


def residuals(
    windows: Windows,
    scale: Scale,
    pose: Array,
    slope: Array | None,
    theta_count: int,
    sensors: Array,
    zero: Array,
) -> Residuals:
    """Errors of simulated poses (steps + 1, W, 3) with slopes (steps + 1, W, 3, K + NX) or None.

    sensors (4,) in units of SENSOR_SCALE; zero (W,) [rad].
    """
    late_camera, lead, offset, ahead = sensors * SENSOR_SCALE
    late_imu = late_camera + lead
    seen, felt = windows.poses, windows.headings
    at, rate = _interpolated(pose, seen, late_camera)
    turned, turning = _interpolated(pose[..., 2:], felt, late_imu)
    apart = forward(at, ahead) - seen.value
    apart[:, 2] += offset
    e = [
        (apart[:, :2] / scale.position).ravel(),
        apart[:, 2] / scale.heading,
        (turned[:, 0] + zero[felt.window] - felt.value) / scale.orientation,
    ]
    window = np.concatenate([np.repeat(seen.window, 2), seen.window, felt.window])
    trust = _trust(windows, scale)
    joined = trust * np.concatenate(e)
    joined = np.where(np.isfinite(joined), np.clip(joined, -LOST, LOST), LOST)
    if slope is None:
        nothing = np.zeros((len(joined), 0))
        return Residuals(window, joined, nothing, nothing)
    d_pose, _ = _interpolated(slope, seen, late_camera)
    cos, sin = np.cos(at[:, 2]), np.sin(at[:, 2])
    d_pose[:, 0] -= ahead * sin[:, None] * d_pose[:, 2]
    d_pose[:, 1] += ahead * cos[:, None] * d_pose[:, 2]
    d_turned, _ = _interpolated(slope[:, :, 2:], felt, late_imu)
    J = np.concatenate(
        [
            d_pose[:, :2].reshape(-1, slope.shape[3]) / scale.position,
            d_pose[:, 2] / scale.heading,
            d_turned[:, 0] / scale.orientation,
        ]
    )
    J *= trust[:, None]
    J = np.where(np.isfinite(J) & (np.abs(J) < STEEPEST), J, 0.0)
    Js, zero_slope = _sensor_slopes(scale, rate, turning, np.column_stack([cos, sin]))
    return Residuals(
        window,
        joined,
        np.column_stack([J[:, :theta_count], trust[:, None] * Js]),
        np.column_stack([J[:, theta_count:], trust * zero_slope]),
    )


def _trust(windows: Windows, scale: Scale) -> Array:
    """(R,) factor of each error by its age at the window's end."""
    seen, felt = (
        1.0 / (1.0 + (windows.steps * DT - samples.t) / scale.fading)
        for samples in (windows.poses, windows.headings)
    )
    return np.concatenate([np.repeat(seen, 2), seen, felt])


def _sensor_slopes(scale: Scale, rate: Array, turning: Array, along: Array) -> tuple[Array, Array]:
    """(R, 4) along the sensors' parameters and (R,) along the heading zero."""
    F, Q = len(rate), len(turning)
    Js = np.zeros((3 * F + Q, len(SENSORS)))
    Js[: 2 * F, 0] = -rate[:, :2].ravel() / scale.position
    Js[: 2 * F, 3] = along.ravel() / scale.position
    Js[2 * F : 3 * F, 0] = -rate[:, 2] / scale.heading
    Js[2 * F : 3 * F, 2] = 1.0 / scale.heading
    Js[3 * F :, :2] = -turning[:, :1] / scale.orientation
    zero_slope = np.zeros(3 * F + Q)
    zero_slope[3 * F :] = 1.0 / scale.orientation
    return np.nan_to_num(np.clip(Js * SENSOR_SCALE, -STEEPEST, STEEPEST)), zero_slope


def _interpolated(values: Array, samples: Samples, late: float) -> tuple[Array, Array]:
    """Values (T, W, ...) and their rates at samples that show what was `late` [s] before: (F, ...) each."""
    position = np.clip((samples.t - late) / DT, 0.0, len(values) - 1.001)
    low = position.astype(int)
    share = (position - low).reshape(-1, *([1] * (values.ndim - 2)))
    below, above = values[low, samples.window], values[low + 1, samples.window]
    return below + share * (above - below), (above - below) / DT
