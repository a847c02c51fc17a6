# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Unit and axes of the accelerometer: gravity along z, the camera's path along x and y.

The camera's path shows which of eight directions of the x and y axes fits, and the scale. Turned by the heading psi, the
specific force f is the acceleration of the camera's position x. With a window w that ends in zero with its slope, parts move
the derivatives onto the window, so no noisy position is differentiated:

    integral of w'' x = s integral of w R(psi) (M f - bias - gravity along the tilt) + integral of w'' R(psi) lever

M is one of the eight matrices that swap axes or change their signs; s is 1 where both use metres. Bias, lever (from the IMU
to the camera's point) and the part of gravity are fitted; the tilt is the integral of gyro x and y. Short windows see the
strokes, long ones turns and changes of speed. The likelihood of a direction is that of normal errors with the variance that it
leaves, at any s > 0:

    log L = sum over lengths of windows of -n / 2 log(1 - correlation^2),  n: windows with something of their own
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fish_bag.problem import Problem
from fish_bag.record_comparison import FEWEST, GRID_S, Array, common_grid, integral, without_trend
from fish_bag.trial import Camera, Imu

HALF_WINDOWS_S = (0.3, 1.0)  # half a stroke of 2 Hz and more; two strokes
STEPS = 4  # windows begin so many times in half a window
OWN_SHARE = 0.5  # share of windows that tell something of their own
FEWEST_WINDOWS = 24
SLOWEST = 6  # samples of either record in half a window
LONGEST_GAP_S = 0.15  # between frames in a window
SURE = 15.0  # difference of log likelihoods from which a direction is ruled out
FITS = 0.7  # correlation of a direction that is named
CLOSEST = 0.9999  # correlation that closed-form recordings reach

# what the IMU's axes are -> the matrix that turns its x and y into forward and left
DIRECTIONS: dict[str, Array] = {
    "as recorded": np.array([[1.0, 0.0], [0.0, 1.0]]),
    "the IMU turned by 180 deg about z": np.array([[-1.0, 0.0], [0.0, -1.0]]),
    "the IMU turned by 90 deg about z": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "the IMU turned by -90 deg about z": np.array([[0.0, 1.0], [-1.0, 0.0]]),
    "the other sign of y": np.array([[1.0, 0.0], [0.0, -1.0]]),
    "the other sign of x": np.array([[-1.0, 0.0], [0.0, 1.0]]),
    "x and y swapped": np.array([[0.0, 1.0], [1.0, 0.0]]),
    "x and y swapped with the other sign of both": np.array([[0.0, -1.0], [-1.0, 0.0]]),
}
RECORDED = "as recorded"
MIRRORED = "the other sign of y"
GRAVITY = 9.81  # m/s^2
UNITS = {1.0: "g", 1000.0: "thousandths of g", 981.0: "cm/s^2", 32.19: "feet/s^2"}


@dataclass(frozen=True)
class FeltAcceleration:
    """How well each direction of the accelerometer's axes fits the camera's path."""

    likelihood: dict[str, float]  # log L by direction, 0 where nothing fits
    correlation: dict[str, float]  # the largest of the window lengths
    slopes: dict[str, tuple[float, float]]  # s by regression either way; the truth lies between

    @property
    def best(self) -> str:
        """The direction that fits best."""
        return max(self.likelihood, key=lambda name: self.likelihood[name])


def felt_acceleration(imu: Imu, camera: Camera) -> FeltAcceleration | None:
    """Compare them; None where they do not overlap or too few windows are covered."""
    t = common_grid(imu.t, camera.t)
    made = [rows for half in HALF_WINDOWS_S if (rows := _rows(imu, camera, t, half)) is not None]
    if not made:
        return None
    likelihood = dict.fromkeys(DIRECTIONS, 0.0)
    closest = dict.fromkeys(DIRECTIONS, 0.0)
    slopes = dict.fromkeys(DIRECTIONS, (0.0, 0.0))
    for seen, felt in made:
        independent = OWN_SHARE * len(seen) / STEPS
        for name, direction in DIRECTIONS.items():
            told = felt @ direction.ravel()
            both, own, other = float(told @ seen), float(told @ told), float(seen @ seen)
            if both <= 0.0:
                continue
            r = min(both / np.sqrt(own * other), CLOSEST)
            likelihood[name] -= independent * np.log(1.0 - r**2)
            if r > closest[name]:
                closest[name], slopes[name] = r, (both / own, other / both)
    return FeltAcceleration(likelihood, closest, slopes)


def _rows(imu: Imu, camera: Camera, t: Array, half: float) -> tuple[Array, Array] | None:
    """Accelerations seen (2W,) and felt (2W, 4: by entry of M, row by row), both less bias, lever and gravity."""
    n = round(half / GRID_S)
    period = max(float(np.median(np.diff(record.t))) for record in (imu, camera))
    if len(t) < 2 * n + 1 or period > half / SLOWEST:
        return None
    w, dd = _windows(n)

    def filtered(values: Array, weights: Array) -> Array:
        return np.convolve(values, weights, "valid")[:: n // STEPS]

    covered = filtered(_gaps(camera.t, t) + _gaps(imu.t, t), np.ones(2 * n + 1)) == 0
    if covered.sum() < FEWEST_WINDOWS:
        return None
    psi = np.interp(t, camera.t, np.unwrap(camera.psi))
    cos, sin = np.cos(psi), np.sin(psi)

    def turned(values: Array, weights: Array) -> Array:
        """(W, 2, 2) of windows, axes of the pool, body axes along which the values act."""
        c, s = filtered(cos * values, weights), filtered(sin * values, weights)
        return np.stack([[c, -s], [s, c]]).transpose(2, 0, 1)

    places = (np.interp(t, camera.t, values) for values in (camera.x, camera.y))
    seen = np.stack([filtered(place, dd) for place in places], axis=1)
    force = [np.interp(t, imu.t, imu.accel[:, axis]) for axis in (0, 1)]
    tilts = [without_trend(t, np.interp(t, imu.t, integral(imu.t, imu.gyro[:, i]))) for i in (0, 1)]
    felt = np.stack([turned(f, w) for f in force], axis=-1).reshape(len(seen), 2, 4)
    one = np.ones(len(t))
    parts = [turned(one, w), turned(one, dd), *(turned(tilt, w) for tilt in tilts)]
    base = np.concatenate(parts, axis=2)[covered].reshape(-1, 2 * len(parts))
    rest, _ = np.linalg.qr(base)
    columns = np.column_stack([seen[covered].reshape(-1, 1), felt[covered].reshape(-1, 4)])
    columns -= rest @ (rest.T @ columns)
    return columns[:, 0], columns[:, 1:]


def _windows(n: int) -> tuple[Array, Array]:
    """A Hann window of 2n + 1 grid points with sum 1, and its second derivative: 0 for lines, 1 for t^2 / 2."""
    tau = np.arange(-n, n + 1) / n
    w = 1.0 + np.cos(np.pi * tau)
    dd = -np.cos(np.pi * tau)
    dd -= dd.mean()
    return w / w.sum(), dd / (dd @ (0.5 * (n * GRID_S * tau) ** 2))


def _gaps(times: Array, t: Array) -> Array:
    """(T,) 1 where the record has no sample near a grid point, else 0."""
    following = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    return (times[following] - times[following - 1] > LONGEST_GAP_S).astype(np.float64)


def check_gravity(imu: Imu) -> Iterator[Problem]:
    """Specific force of a robot that is not thrown about is gravity, upwards."""
    force = np.median(imu.accel, axis=0)
    size = float(np.median(np.linalg.norm(imu.accel, axis=1)))
    if not np.isfinite(size) or len(imu) < FEWEST:
        return
    if not 0.7 * GRAVITY < size < 1.4 * GRAVITY:
        close = [name for value, name in UNITS.items() if 0.985 < size / value < 1.015]
        close += ["g"] if 0.7 < size < 1.4 else []
        guess = close[0] if close else "gravity taken out" if size < 0.3 * GRAVITY else ""
        held = f"specific force is {size:.3g} throughout{f' ({guess}?)' if guess else ''}"
        text = f"{held}; expected {GRAVITY} m/s^2, gravity included: publish m/s^2"
        yield Problem("error", "accel_unit", imu.topic, text)
        return
    if force[2] < 0.7 * size:
        axis = int(np.argmax(np.abs(force)))
        up = f"{'-' if force[axis] < 0 else '+'}{'xyz'[axis]}"
        text = (
            f"gravity lies along {up}, expected +z: axes are swapped or mirrored; "
            "turn them where the IMU is published"
        )
        yield Problem("error", "accel_axes", imu.topic, text)


def check_directions(imu: Imu, felt: FeltAcceleration) -> Iterator[Problem]:
    """The directions of x and y that the camera's path shows, if the recorded ones are ruled out."""
    best = felt.best
    most = felt.likelihood[best]
    if felt.correlation[best] < FITS or most - felt.likelihood[RECORDED] < SURE:
        return
    names = [
        best,
        *(n for n, log_l in felt.likelihood.items() if n != best and most - log_l < SURE),
    ]
    recorded = felt.correlation[RECORDED]
    turned = all(np.linalg.det(DIRECTIONS[name]) > 0 for name in names)
    remedy = "turn the axes in the IMU's driver"
    if not turned:
        remedy = "mend the sign in the IMU's driver, or in the camera's if its y is mirrored"
    text = (
        f"specific force fits the camera's path with {' or '.join(names)} (correlation "
        f"{felt.correlation[best]:.2f}, as recorded {recorded:.2f}); expected x forward, y left: "
        f"{remedy}"
    )
    yield Problem("error", "accel_axes", imu.topic, text)
