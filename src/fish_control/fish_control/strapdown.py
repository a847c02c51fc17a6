# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Strapdown motion model of the head: inertial measurements drive it, the camera corrects it.

State x = (p_x, p_y, psi, v_x, v_y, b_g, b_x, b_y): position [m] and heading [rad] in the pool, velocity over
ground in the pool frame [m/s], bias of the yaw rate [rad/s] and of both accelerometer axes [m/s^2].

    p' = v,   psi' = w - b_g,   v' = R(psi) (a - b)
    z_camera = (p_x, p_y, psi) + noise

w is the rate of the IMU's own heading, a the specific force in base_link; the pool is level and the fish swims upright, so
gravity has no share in the plane (what tilt adds is taken up by the biases). The rotor's swing of the head is in the
measurements. All samples between two moments are integrated at once (preintegration).

The noises follow the data: one factor each for positions and headings, which a share of the innovations exceeds.
Sources: Titterton and Weston, Strapdown Inertial Navigation Technology, ch. 3, planar; Forster et al., On-manifold
preintegration, 2017.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from fish_control.imu_heading import COASTING_TIME, SAMPLE_PERIOD
from fish_control.imu_history import Interval
from fish_control.noise_scale import NoiseScale

Array = NDArray[np.float64]
SIZE = 8
POSE = slice(0, 3)
H_CAMERA = np.eye(3, SIZE)


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations of the motion model; per sample means per sample at 100 Hz."""

    gyro_noise: float = 0.006  # rad/s per sample
    accel_noise: float = 0.05  # m/s^2 per sample
    gyro_drift: float = 1e-4  # rad/s per sqrt(s), of the bias
    accel_drift: float = 1e-3  # m/s^2 per sqrt(s), of the biases
    heading_drift: float = 0.001  # rad per sqrt(s), of the IMU's heading against the camera's
    coasting_yaw_rate: float = (
        2.0  # rad/s, unknown yaw rate without IMU (the head swings at up to 4 rad/s)
    )
    coasting_accel: float = 1.0  # m/s^2, unknown acceleration without IMU


class StrapdownFilter:
    """filterpy's extended Kalman filter with the motion model above.

    Args:
        noise: its constants.
        scale: factors on the variances, which may change; all 1 without.
    """

    def __init__(self, noise: MotionNoise, scale: NoiseScale | None = None) -> None:
        self._noise, self._scale = noise, scale or NoiseScale(first_process=1.0)
        self._filter = ExtendedKalmanFilter(dim_x=SIZE, dim_z=3)

    @property
    def x(self) -> Array:
        """State (8,); see the module."""
        state: Array = self._filter.x
        return state

    @property
    def P(self) -> Array:
        """Its covariance (8, 8)."""
        covariance: Array = self._filter.P
        return covariance

    def set(self, x: Array, P: Array) -> None:
        """Continue from this state; the arrays are copied."""
        self._filter.x, self._filter.P = x.copy(), P.copy()

    def advance(self, imu: Interval) -> None:
        """Predict over an interval of the IMU."""
        x, time = self.x, imu.time
        dt = np.diff(time)
        middle = 0.5 * (time[1:] + time[:-1])
        since, left = middle - time[0], time[-1] - middle
        known = imu.accel_known.astype(float)
        turned = np.concatenate(([0.0], np.cumsum(np.where(imu.yaw_known, np.diff(imu.yaw), 0.0))))
        biased = np.where(imu.yaw_known, x[5], 0.0) * dt  # without an IMU nothing is biased
        drifted = np.concatenate(([0.0], np.cumsum(biased)))
        heading = turned - drifted
        psi = x[2] + 0.5 * (heading[1:] + heading[:-1])
        c, s = np.cos(psi), np.sin(psi)
        force = (0.5 * (imu.accel[1:] + imu.accel[:-1]) - x[6:8]) * known[:, None]
        dv = dt[:, None] * np.column_stack(
            [c * force[:, 0] - s * force[:, 1], s * force[:, 0] + c * force[:, 1]]
        )
        F = self._jacobian(dt, since, left, dv, np.column_stack([c, s]) * known[:, None])
        F[2, 5] = -float(dt @ imu.yaw_known)
        T = float(time[-1] - time[0])
        x[0:2] += T * x[3:5] + left @ dv
        x[2] = math.remainder(x[2] + heading[-1], 2.0 * math.pi)
        x[3:5] += dv.sum(axis=0)
        P = F @ self.P @ F.T + self._process_noise(imu, dt, left, dv)
        self._filter.P = 0.5 * (P + P.T)

    def innovation(self, pose: Array, R: Array) -> tuple[Array, Array]:
        """z - h(x) of a camera pose (x, y, psi) and its covariance S; R is scaled as the other noises are."""
        return pose_residual(pose, self.x[POSE]), self.P[POSE, POSE] + R

    def correct(self, pose: Array, R: Array, fade: float = 1.0) -> None:
        """Update with a camera pose (x, y, psi) [m, m, rad]; fade: multiplies the predicted covariance before."""
        self._filter.P = fade * self.P
        self._filter.update(pose, lambda _: H_CAMERA, lambda x: x[POSE], R, residual=pose_residual)
        self.x[2] = math.remainder(self.x[2], 2.0 * math.pi)

    @staticmethod
    def _jacobian(dt: Array, since: Array, left: Array, dv: Array, direction: Array) -> Array:
        """d x(end) / d x(start); direction: (c, s) of the head in each step, 0 where the acceleration is unknown."""
        F = np.eye(SIZE)
        F[0, 3] = F[1, 4] = dt.sum()
        turned = np.column_stack([-dv[:, 1], dv[:, 0]])  # d dv / d psi
        axes = np.column_stack([dt[:, None] * direction, left[:, None] * dt[:, None] * direction])
        c, s, c_left, s_left = axes.sum(axis=0)
        F[3:5, 2], F[0:2, 2] = turned.sum(axis=0), left @ turned
        F[3:5, 5], F[0:2, 5] = -since @ turned, -(left * since) @ turned
        F[3:5, 6:8] = [[-c, s], [-s, -c]]
        F[0:2, 6:8] = [[-c_left, s_left], [-s_left, -c_left]]
        return F

    def _process_noise(self, imu: Interval, dt: Array, left: Array, dv: Array) -> Array:
        n, Q = self._noise, np.zeros((SIZE, SIZE))
        position_scale, heading_scale = self._scale.position.motion, self._scale.heading.motion
        known, coasting = n.accel_noise**2 * SAMPLE_PERIOD, n.coasting_accel**2 * COASTING_TIME
        speed = dt * np.where(imu.accel_known, known * position_scale, coasting)
        for p, v in ((0, 3), (1, 4)):
            Q[v, v] = speed.sum()
            Q[p, v] = Q[v, p] = speed @ left
            Q[p, p] = speed @ (left * left + dt * dt / 12.0)
        unknown = n.coasting_yaw_rate**2 * COASTING_TIME * dt
        known_turn = (imu.yaw_variance + n.heading_drift**2 * dt) * heading_scale
        turn = np.where(imu.yaw_known, known_turn, unknown)
        # a turn in one step turns the accelerations of all later ones
        turned = np.column_stack([-dv[:, 1], dv[:, 0]])
        G = np.zeros((len(dt), 5))
        G[:, 3:5] = _after(turned)
        G[:, 0:2] = _after(left[:, None] * turned)
        G[:, 2] = 1.0
        Q[:5, :5] += (G * turn[:, None]).T @ G
        T = dt.sum()
        Q[5, 5] = n.gyro_drift**2 * T
        Q[6, 6] = Q[7, 7] = n.accel_drift**2 * position_scale * T
        return Q


def _after(values: Array) -> Array:
    """For each row, the sum of the rows after it and of half of it."""
    total = np.cumsum(values[::-1], axis=0)[::-1]
    return total - 0.5 * values


def pose_residual(z: Array, predicted: Array) -> Array:
    """Difference of two poses, the heading's the short way round."""
    y = z - predicted
    y[2] = math.remainder(y[2], 2.0 * math.pi)
    return y
