# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The signals of one trial on the filter's grid: levelled IMU readings, samples of other clocks, rest at the start.

With R from imu_link to a level frame with the z axis up, from the IMU's own orientation, and psi its heading:

    (a_x, a_y, a_z) = R_z(-psi) R f,   level forward and left;   r = (R omega)_z

Without it a roll of 0.03 rad puts 0.3 m/s^2 of gravity on the accelerometer's left axis, as much as the strokes do.
Readings without an orientation are taken as those of an IMU that stays level.

A sample 4 ms off that is taken for one of the grid's looks like a camera that is late by as much, one of an encoder like a rotor
that lags. Between samples runs a spline of the fifth degree: it keeps white noise nearly white (at worst, half-way between two
samples, 0.83 of the variance and 1.2 times the density that such a variance has at low frequencies; a straight line has 0.5 and
1.9) and follows 20 Hz to 0.1 % of the amplitude where 100 samples come in a second.

A filter may start with a small variance of its speed where a trial starts at rest. The first gyro sample shows whether the fish
turns, the first encoder sample whether the rotor does. Only the camera sees a straight glide, over some frames in which the first
strokes push a fish at rest 3 cm as well. The accelerometer measures these.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from fish_bag.trial import Imu
from fish_sim.model import DT

Array = NDArray[np.float64]

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])  # quaternion x, y, z, w of no turn
SHORTEST = 0.5  # length of a quaternion that says how the IMU is turned; 1 is right
DEGREE = 5
GAP = 2.5  # periods between two samples that no spline bridges
CLOSE = 0.3  # periods; across samples so close together, noise would throw a curve far off
ROUNDING = 1e-6  # s, of stamps
EARLY = 0.05  # steps by which a sample may come too early to stand alone at its grid point: a clock that runs a little fast
TURNS = 0.1  # rad/s, more than a gyro's bias
SPINS = 5.0  # rad/s of the rotor; strokes have tens and hundreds
FIRST_POSES = 0.3  # s
FEWEST_POSES = 3  # that tell how a fish moves
# m in FIRST_POSES; at rest the recordings looked at have 14 mm at most, a fish at 0.1 m/s has 30
GLIDES = 0.02


def level(imu: Imu) -> tuple[Array, Array]:
    """Yaw rate (N,) [rad/s] about the vertical and specific force (N, 2) [m/s^2] level forward and left."""
    given = _oriented(imu)
    R = rotation(np.where(given[:, None], imu.orientation, LEVEL))
    rate, force = np.einsum("nj,nj->n", R[:, 2], imu.gyro), np.einsum("nij,nj->ni", R, imu.accel)
    psi = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    return rate, np.column_stack(in_base_link(force[:, 0], force[:, 1], psi))


def in_base_link(x: Array, y: Array, heading: Array) -> tuple[Array, Array]:
    """Forward and left components (...) of vectors with pool-frame components x and y (...), at headings (...) [rad]."""
    cos, sin = np.cos(heading), np.sin(heading)
    return x * cos + y * sin, y * cos - x * sin


def heading(imu: Imu) -> tuple[Array, Array]:
    """(stamps (Q,) [s], headings (Q,) [rad]) of the readings with an orientation, unwrapped, an unknown constant added."""
    given = _oriented(imu)
    R = rotation(imu.orientation[given])
    return imu.t[given], np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))


def _oriented(imu: Imu) -> NDArray[np.bool_]:
    """Which readings (N,) have an orientation: finite, and of a length that is no rounding of 0."""
    length = np.linalg.norm(imu.orientation, axis=1)
    return np.asarray(np.isfinite(length) & (length > SHORTEST))


def rotation(quaternion: Array) -> Array:
    """(N, 3, 3) matrices of quaternions (N, 4) x, y, z, w, which need not be normalised."""
    x, y, z, w = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def on_grid(t: Array, values: Array, grid: Array, step: float) -> Array:
    """(G, ...) values at the times grid (G,) of samples (N, ...) with stamps t (N,) in order; all times in s.

    A grid point has a value where a sample lies within half a step and the samples reach to both sides of it: as many values as
    there were samples that come every step or more slowly, one at every grid point of faster ones. Elsewhere NaN.
    """
    out = np.full((len(grid), *values.shape[1:]), np.nan)
    if not len(t):
        return out
    t, first = np.unique(t, return_index=True)
    values, period = values[first], float(np.median(np.diff(t))) if len(t) > 1 else step
    around = np.concatenate([[-np.inf], t, [np.inf]])
    after = np.searchsorted(t, grid) + 1
    near = np.minimum(grid - around[after - 1], around[after] - grid) <= 0.5 * step + ROUNDING
    for run in np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > GAP * period) + 1):
        own = near & (grid >= t[run[0]] - ROUNDING) & (grid <= t[run[-1]] + ROUNDING)
        out[own] = _curve(t[run], values[run], grid[own], period)
    return out


def apart(t: Array, step: float) -> NDArray[np.int64]:
    """Which samples with stamps t (N,) [s] in order to keep so that each finds a grid point of its own, wherever the grid begins.

    Those that come a step or more after each other are all kept. Of faster ones, two at one grid point would have to be one.
    """
    kept, free = [], -np.inf
    for i, now in enumerate(t.tolist()):
        if now >= free - EARLY * step:
            kept.append(i)
            free = max(now, free) + step
    return np.array(kept, dtype=np.int64)


def _curve(t: Array, values: Array, at: Array, period: float) -> Array:
    """(A, ...) values between the samples of a run without gaps."""
    if len(t) == 1 or not len(at):
        return np.repeat(values[:1], len(at), axis=0)
    smooth = len(t) > DEGREE and np.diff(t).min() > CLOSE * period
    curve: Array = make_interp_spline(t, values, k=DEGREE if smooth else 1)(
        np.clip(at, t[0], t[-1])
    )
    return curve


def starts_at_rest(gyro: Array, accel: Array, encoder: Array, t: Array, pose: Array) -> bool:
    """Whether nothing moves at the first grid point of a trial.

    gyro (T,) [rad/s], accel (T, 2) level forward and left [m/s^2], encoder (T,) [rad/s], NaN where a sensor says nothing (no
    encoder and too few poses speak for rest, no gyro does not); pose (F, 3) of the camera at times t (F,) [s].
    """
    turns, spins = not abs(gyro[0]) < TURNS, abs(encoder[0]) >= SPINS
    early = t < FIRST_POSES
    if turns or spins or early.sum() < FEWEST_POSES:
        return not (turns or spins)
    pushed = _pushed(gyro, accel, float(np.median(pose[early][:FEWEST_POSES, 2])))
    moved = np.array(
        [np.interp(t[early], DT * np.arange(len(pushed)), along) for along in pushed.T]
    ).T
    # an image that is older than its stamp does not show the strokes yet that the accelerometer felt: less of the two counts
    return (
        min(_glide(t[early], pose[early, :2]), _glide(t[early], pose[early, :2] - moved)) < GLIDES
    )


def _pushed(gyro: Array, accel: Array, heading: float) -> Array:
    """(K, 2) how far [m] the forces of the first moments have moved the fish at each grid point, along the pool's axes."""
    count = round(FIRST_POSES / DT) + 1
    rate, (forward, left) = np.nan_to_num(gyro[:count]), np.nan_to_num(accel[:count]).T
    psi = heading + DT * np.cumsum(rate)
    cos, sin = np.cos(psi), np.sin(psi)
    force = np.column_stack([forward * cos - left * sin, forward * sin + left * cos])
    moved: Array = DT**2 * np.cumsum(np.cumsum(force, axis=0), axis=0)
    return np.concatenate([np.zeros((1, 2)), moved])


def _glide(t: Array, place: Array) -> float:
    """How far [m] a straight line through places (F, 2) at times t goes in FIRST_POSES."""
    velocity = np.polyfit(t - t.mean(), place, 1)[0]
    return FIRST_POSES * float(np.hypot(velocity[0], velocity[1]))


def in_holes(known: NDArray[np.bool_], longest: int) -> NDArray[np.bool_]:
    """Which grid points (T,) lie between known ones that are more than `longest` points apart.

    So do those before the first and after the last of them, where these are more than that.
    """
    places = np.concatenate([[-1], np.flatnonzero(known), [len(known)]])
    interval = np.searchsorted(places, np.arange(len(known)), side="right") - 1
    return np.asarray((np.diff(places)[interval] > longest) & ~known)
