# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Camera and accelerometer against each other: scale of positions, axes of the IMU.

Turned by the heading psi, the specific force f is the acceleration of the camera's position x. With a window w that ends in zero
with its slope, parts move the derivatives onto the window, so no noisy position is differentiated:

    integral of w'' x = factor R(angle) integral of w R(psi) (f - bias) + integral of w'' R(psi) lever

Turning gives the centripetal acceleration r u, changes of speed the forward one. The lever is that from the IMU to the camera's
point; the bias is constant in a trial. Noise of a regressor pulls its coefficient to zero (Fuller 1987, attenuation): they
are divided by the share of its variance that is no noise, from the difference of every other sample to those between.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.camera import HOLE as PAUSE
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.grid import in_holes
from fish_sysid.dataset.imu import HOLE
from fish_sysid.diagnosis.symmetry.finding import Estimate, SymmetryFinding, SymmetryTest
from fish_sysid.diagnosis.symmetry.regression import Judged, Rows, judge, least_squares
from fish_sysid.estimation.thresholds import (
    FEWEST_TRIALS,
    LEAST_ACCELERATION,
    LEAST_OWN_SHARE,
    SENSOR_GAIN,
    SMALLEST_ANGLE,
    SMALLEST_SCALE,
    SMALLEST_Z,
    SYMMETRY_LEVEL,
)

Array = NDArray[np.float64]

HALF_WINDOW = 1.0  # s; two strokes
STEP = 0.45  # s between windows; not whole strokes, as in `stroke_means`
LEAST_FRAMES = 15  # in a window
AGREE = 3.0  # standard errors
COVERED = 0.5  # of a trial, that lies between samples of the IMU that are HOLE apart or less
LARGEST_SPREAD = 0.1  # rad, rms of the camera's heading less the gyro's integral in a trial

CAMERA_SCALE = SymmetryTest(
    "camera_scale",
    "sensor",
    assumes="the accelerometer's scale is right",
    needs="an IMU, three trials, turns or changes of speed",
)
IMU_AXES = SymmetryTest(
    "imu_misalignment",
    "sensor",
    assumes="the course tells whether this angle between marker and IMU is that of the marker",
    needs="an IMU, three trials, turns or changes of speed",
)


def accelerations(experiment: Experiment) -> tuple[SymmetryFinding, SymmetryFinding]:
    """The tests for `camera_scale` and `imu_misalignment`."""
    if not (np.isfinite(experiment.gyro).any() and np.isfinite(experiment.accel).any()):
        return _both("no IMU sample can be used")
    made = [r for m in range(len(experiment.names)) if (r := _rows(experiment, m)) is not None]
    if len(made) < FEWEST_TRIALS:
        return _both(
            "fewer than three trials in which gyro, accelerometer and camera go together, "
            f"the IMU at {1.0 / HOLE:.0f} Hz or more without pauses"
        )
    rows, noise = [r for r, _ in made], float(np.mean([square for _, square in made]))
    square = float(np.mean(np.concatenate([r.terms[:, 0] for r in rows]) ** 2))
    if square < LEAST_ACCELERATION**2:
        return _both(f"no turns and one speed: accelerations vary by {square**0.5:.3f} m/s^2")
    judged = judge(rows)
    if judged.own_share < LEAST_OWN_SHARE:
        return _both("one kind of turn: a lever between IMU and camera's point looks the same")
    return _conclude(judged, 1.0 - noise / square)


def _both(reason: str) -> tuple[SymmetryFinding, SymmetryFinding]:
    return CAMERA_SCALE.cannot_tell(reason), IMU_AXES.cannot_tell(reason)


def _conclude(judged: Judged, reliable: float) -> tuple[SymmetryFinding, SymmetryFinding]:
    """Factor and angle; the coefficients are factor cos(angle) - 1 and factor sin(angle)."""
    along, across = (1.0 + judged.coefficients[-2]) / reliable, judged.coefficients[-1] / reliable
    std = judged.std[-2:] / reliable
    factor = Estimate(float(np.hypot(along, across)), float(std[0]), "1")
    angle = Estimate(float(np.arctan2(across, along)), float(std[1] / factor.value), "rad")
    better = judged.evidence.gain > SENSOR_GAIN and judged.evidence.p_value < SYMMETRY_LEVEL
    scaled = better and abs(factor.value - 1.0) > max(SMALLEST_SCALE, SMALLEST_Z * factor.std)
    turned = better and abs(angle.value) > max(SMALLEST_ANGLE, SMALLEST_Z * angle.std)
    by_scale = f"positions of the camera are {factor.value:.3f} times those felt"
    by_angle = f"the IMU is turned by {angle.value:.3f} rad against the heading marker"
    return (
        CAMERA_SCALE.answer(scaled, by_scale, {"factor": factor}, judged.evidence),
        IMU_AXES.answer(turned, by_angle, {"angle": angle}, judged.evidence),
    )


def marker_or_imu(
    marker: SymmetryFinding, imu: SymmetryFinding
) -> tuple[SymmetryFinding, SymmetryFinding]:
    """Which of the two is turned: the marker by `offset` shows an IMU turned by -offset.

    Where the course shows the same angle it is the marker, and no asymmetric hull, which would not turn the accelerations.
    Where the course shows none it is the IMU. Otherwise neither is named.
    """
    if imu.status != "found":
        return marker, imu
    if marker.status == "cannot tell":
        return marker, replace(imu, stands_alone=False)
    offset, angle = marker.parameters["offset"], imu.parameters["angle"]
    apart, std = abs(offset.value + angle.value), float(np.hypot(offset.std, angle.std))
    if marker.status == "found":
        same = apart < AGREE * std
        return replace(marker, stands_alone=same), replace(imu, stands_alone=False)
    none = abs(offset.value) < AGREE * offset.std or abs(offset.value) < SMALLEST_ANGLE
    return marker, replace(imu, stands_alone=none and apart > AGREE * std)


def _rows(experiment: Experiment, m: int) -> tuple[Rows, float] | None:
    """Both components of every window of a trial, and the mean square of the force's noise in them.

    None where a sensor is missing, the IMU covers too little of the trial or pauses, or the heading is not followed.
    """
    steps, frames = int(experiment.steps[m]), experiment.frames[m]
    t: Array = DT * np.arange(steps, dtype=np.float64)
    gyro, accel = experiment.gyro[:steps, m], experiment.accel[:steps, m]
    known = np.isfinite(gyro) & np.isfinite(accel).all(axis=1)
    gaps = np.diff(np.flatnonzero(known))
    covered = gaps[gaps <= round(HOLE / DT)].sum()
    if covered < COVERED * (steps - 1) or len(frames.t) < LEAST_FRAMES:
        return None
    if in_holes(known, round(PAUSE / DT)).any():  # the heading afterwards would be a guess
        return None
    rate = np.interp(t, t[known], gyro[known])
    heading, spread = followed_heading(t, rate, frames.t, frames.pose[:, 2])
    return None if spread > LARGEST_SPREAD else force_rows(experiment, m, heading)


def force_rows(experiment: Experiment, m: int, heading: Array) -> tuple[Rows, float] | None:
    """`_rows` of trial m with the heading (T,) [rad] at every grid point; None where too few windows are covered."""
    steps, frames = int(experiment.steps[m]), experiment.frames[m]
    t: Array = DT * np.arange(steps, dtype=np.float64)
    accel = experiment.accel[:steps, m]
    measured_at: NDArray[np.bool_] = np.asarray(np.isfinite(accel).all(axis=1))
    known = np.flatnonzero(measured_at)
    if len(known) < LEAST_FRAMES:
        return None
    felt = np.column_stack([np.interp(t, t[known], v[known]) for v in accel.T])
    lost = in_holes(measured_at, round(PAUSE / DT))
    signs = np.where(np.arange(len(known)) % 2, -1.0, 1.0)  # every other sample less those between
    others = np.column_stack([np.interp(t, t[known], signs * v[known]) for v in accel.T])
    turn = _turn(heading)
    force, other_force = (np.einsum("tij,tj->ti", turn, x) for x in (felt, others))
    measured, terms, base, noise = [], [], [], []
    for centre in np.arange(HALF_WINDOW, t[-1] - HALF_WINDOW, STEP):
        seen = np.abs(frames.t - centre) < HALF_WINDOW
        if seen.sum() < LEAST_FRAMES or lost[np.abs(t - centre) < HALF_WINDOW].any():
            continue
        w, dd = window(t - centre)
        seconds = second_derivative(frames.t[seen] - centre, frames.pose[seen, :2])
        a, bias, lever = (
            w @ force,
            np.einsum("t,tij->ij", w, turn),
            np.einsum("t,tij->ij", dd, turn),
        )
        noise.append(np.mean((w @ other_force) ** 2))
        measured.append(seconds - a)
        terms.append(np.column_stack([a, [-a[1], a[0]]]))
        base.append(np.hstack([bias, lever]))
    if len(measured) < 5:
        return None
    rows = _less_bias(np.concatenate(base), np.concatenate(terms), np.concatenate(measured))
    return rows, float(np.mean(noise))


def _less_bias(base: Array, terms: Array, measured: Array) -> Rows:
    """Rows with what the trial's own bias explains taken out of every column; the lever is common to all trials."""
    bias, lever = base[:, :2], base[:, 2:]

    def rest(column: Array) -> Array:
        return np.asarray(column - bias @ least_squares(bias, column))

    columns = [rest(column) for column in np.hstack([lever, terms]).T]
    return Rows(np.column_stack(columns[:2]), np.column_stack(columns[2:]), rest(measured))


def followed_heading(t: Array, gyro: Array, seen: Array, heading: Array) -> tuple[Array, float]:
    """Heading (T,) [rad] by the gyro, with start and bias from the camera, and the rms of what is left [rad]."""
    turned = DT * (np.cumsum(gyro) - 0.5 * gyro)
    line = np.column_stack([np.ones_like(seen), seen])
    apart = heading - np.interp(seen, t, turned)
    fit = least_squares(line, apart)
    rest = apart - line @ fit
    return turned + fit[0] + fit[1] * t, float(np.sqrt(np.mean(rest**2)))


def window(tau: Array) -> tuple[Array, Array]:
    """Weights (T,) on the grid of a Hann window with unit integral, and of its second derivative."""
    inside = np.abs(tau) < HALF_WINDOW
    phase = np.pi * tau / HALF_WINDOW
    w = np.where(inside, 0.5 * (1.0 + np.cos(phase)), 0.0) * DT / HALF_WINDOW
    dd = np.where(inside, np.cos(phase), 0.0) * DT / HALF_WINDOW
    return w, -0.5 * (np.pi / HALF_WINDOW) ** 2 * dd


def second_derivative(tau: Array, position: Array) -> Array:
    """Integral of w'' x (2,) from frames at times tau (F,): weights that are exact for straight lines and parabolas."""
    width = np.gradient(tau)
    weight = -0.5 * (np.pi / HALF_WINDOW) ** 2 * np.cos(np.pi * tau / HALF_WINDOW) / HALF_WINDOW
    weight = weight * width
    line = np.column_stack([np.ones_like(tau), tau])
    weight = weight - line @ np.linalg.lstsq(line.T @ line, line.T @ weight, rcond=None)[0]
    return np.asarray(weight @ position / (weight @ (0.5 * tau**2)))


def _turn(heading: Array) -> Array:
    """Matrices (T, 2, 2) from body to pool."""
    cos, sin = np.cos(heading), np.sin(heading)
    return np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0)
