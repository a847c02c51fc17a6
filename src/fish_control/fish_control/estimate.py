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
    x, P = moment.x, moment.P
    c, s = math.cos(x[2]), math.sin(x[2])
    R = np.array([[c, s], [-s, c]])  # pool to body
    u, v = R @ x[3:5]
    r = 0.0 if yaw_rate is None else yaw_rate - x[5]
    J = np.column_stack([[v, -u], R])  # d (u, v) / d (psi, v_x, v_y)
    twist_P = np.zeros((3, 3))
    twist_P[:2, :2], twist_P[2, 2] = J @ P[2:5, 2:5] @ J.T, P[5, 5] + gyro_noise**2
    if imu_lost or yaw_rate is None:
        twist_P[2, 2] = LOST_VARIANCE
    if imu_lost:
        twist_P = np.eye(3) * LOST_VARIANCE
    motion = np.array([x[3], x[4], r])
    return Estimate(
        time=moment.time,
        pose=x[:3].copy(),
        twist=np.array([u, v, r]),
        pose_covariance=P[:3, :3] + offset_std**2 * np.outer(motion, motion),
        twist_covariance=twist_P,
        gyro_bias=float(x[5]),
        camera_lost=camera_lost,
        imu_lost=imu_lost,
    )
