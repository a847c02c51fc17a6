# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What fusion publishes: pose, velocity and how far to trust them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.measurement_buffer import Moment

Array = NDArray[np.float64]
LOST_VARIANCE = 1e4  # of a twist without IMU: unusable, in any unit
LOST: Array = np.eye(3) * LOST_VARIANCE


@dataclass(frozen=True)
class Estimate:
    """Pose in the pool, velocity over ground in base_link, and how far to trust them."""

    time: float  # s
    pose: Array  # (3,) x [m], y [m], psi [rad]
    twist: Array  # (3,) u [m/s], v [m/s], r [rad/s]
    pose_covariance: Array  # (3, 3)
    twist_covariance: Array  # (3, 3)
    gyro_bias: float  # rad/s
    camera_lost: bool
    imu_lost: bool


def to_estimate(
    moment: Moment,
    yaw_rate: float | None,
    offset_std: float,
    gyro_noise: float,
    camera_lost: bool,
    imu_lost: bool,
) -> Estimate:
    """A filter's state as an estimate.

    yaw_rate: of the IMU [rad/s], None if it measures none; offset_std: of the camera's clock [s], which moves the pose
    along the motion; gyro_noise: rad/s.
    """
    psi, vx, vy, bias = moment.x[2:6].tolist()
    c, s = math.cos(psi), math.sin(psi)
    u, v = c * vx + s * vy, c * vy - s * vx  # pool to body
    r = 0.0 if yaw_rate is None else yaw_rate - bias
    twist_P = LOST.copy()
    if not imu_lost:
        J = np.array(((v, c, s), (-u, -s, c)))  # d (u, v) / d (psi, v_x, v_y)
        twist_P[:2, :2] = J @ moment.P[2:5, 2:5] @ J.T
        if yaw_rate is not None:
            twist_P[2, 2] = moment.P[5, 5] + gyro_noise**2
    motion = np.array((vx, vy, r))
    pose_P = moment.P[:3, :3] + offset_std**2 * (motion[:, None] * motion)
    return Estimate(
        time=moment.time,
        pose=moment.x[:3].copy(),
        twist=np.array([u, v, r]),
        pose_covariance=pose_P,
        twist_covariance=twist_P,
        gyro_bias=bias,
        camera_lost=camera_lost,
        imu_lost=imu_lost,
    )
