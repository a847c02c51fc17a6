# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""IMU readings of a fish that rolls and pitches, for a model that swims level.

With R from imu_link to a level frame with the z axis up, from the IMU's own orientation, and psi its heading:

    (a_x, a_y, a_z) = R_z(-psi) R f,   level forward and left;   r = (R omega)_z

Without it a roll of 0.03 rad puts 0.3 m/s^2 of gravity on the accelerometer's left axis, as much as the strokes do.
Readings without an orientation are taken as those of an IMU that stays level.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_bag.trial import Imu

Array = NDArray[np.float64]

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])  # quaternion x, y, z, w of no turn


def level(imu: Imu) -> tuple[Array, Array]:
    """Yaw rate (N,) [rad/s] about the vertical and specific force (N, 2) [m/s^2] level forward and left."""
    given = np.isfinite(imu.orientation).all(axis=1)
    R = rotation(np.where(given[:, None], imu.orientation, LEVEL))
    rate, force = np.einsum("nj,nj->n", R[:, 2], imu.gyro), np.einsum("nij,nj->ni", R, imu.accel)
    psi = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    cos, sin = np.cos(psi), np.sin(psi)
    forward, left = force[:, 0] * cos + force[:, 1] * sin, force[:, 1] * cos - force[:, 0] * sin
    return rate, np.column_stack([forward, left])


def heading(imu: Imu) -> tuple[Array, Array]:
    """(stamps (Q,) [s], headings (Q,) [rad]) of the readings with an orientation, unwrapped, an unknown constant added."""
    given = np.isfinite(imu.orientation).all(axis=1)
    given &= np.linalg.norm(np.nan_to_num(imu.orientation), axis=1) > 0.5
    R = rotation(imu.orientation[given])
    return imu.t[given], np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))


def rotation(quaternion: Array) -> Array:
    """(N, 3, 3) matrices of quaternions (N, 4) x, y, z, w, which need not be normalised."""
    x, y, z, w = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
