"""Strapdown motion model of the head: inertial measurements drive it, the camera corrects it.

State x = (p_x, p_y, psi, v_x, v_y, b_g, b_x, b_y): position [m] and heading [rad] in the pool, velocity over
ground in the pool frame [m/s], bias of the gyro [rad/s] and of both accelerometer axes [m/s^2].

    p' = v,   psi' = w - b_g,   v' = R(psi) (a - b)
    z_camera = (p_x, p_y, psi) + noise

a is the specific force in base_link; the pool is level and the fish swims upright, so gravity has no share in
the plane (what tilt adds is taken up by the biases). The swing of the head is in the measurements and needs no
model. Source: Titterton and Weston, Strapdown Inertial Navigation Technology, ch. 3, planar; noise: RECORDING.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from fish_control.imu_history import InertialSample

Array = NDArray[np.float64]
SIZE = 8
POSE = slice(0, 3)
H_CAMERA = np.eye(3, SIZE)
SAMPLE_PERIOD = 0.01  # s, for which the noises of MotionNoise are given
COASTING_SAMPLES = 10.0  # sample periods over which an unknown rate or acceleration keeps its sign


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations of the motion model; per sample means per sample at 100 Hz."""

    gyro_noise: float = 0.02  # rad/s per sample; the sensor's 0.006 and the swing between samples
    accel_noise: float = 0.15  # m/s^2 per sample; the sensor's 0.05, tilt, and the swing between samples
    gyro_drift: float = 1e-4  # rad/s per sqrt(s), of the bias
    accel_drift: float = 1e-3  # m/s^2 per sqrt(s), of the biases
    coasting_yaw_rate: float = 2.0  # rad/s, unknown yaw rate without IMU (the head swings at up to 4 rad/s)
    coasting_accel: float = 1.0  # m/s^2, unknown acceleration without IMU


class StrapdownFilter:
    """filterpy's extended Kalman filter with the motion model above."""

    def __init__(self, noise: MotionNoise) -> None:
        self._noise = noise
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

    def advance(self, dt: float, before: InertialSample | None, after: InertialSample | None) -> None:
        """Predict over dt [s] with the mean of the measurements at its ends; None: unknown."""
        known = before is not None and after is not None
        w, a = 0.0, np.zeros(2)
        if before is not None and after is not None:
            mean = 0.5 * (np.array(before) + np.array(after)) - self.x[5:8]
            w, a = float(mean[0]), mean[1:]
        psi = self.x[2] + 0.5 * w * dt
        c, s = math.cos(psi), math.sin(psi)
        R = np.array([[c, -s], [s, c]])
        accel = R @ a
        F = self._jacobian(dt, R, accel) if known else self._coasting_jacobian(dt)
        x = self.x
        x[0:2] += dt * x[3:5] + 0.5 * dt * dt * accel
        x[2] = math.remainder(x[2] + w * dt, 2.0 * math.pi)
        x[3:5] += dt * accel
        self._filter.P = F @ self.P @ F.T + self._process_noise(dt, known)

    def innovation(self, pose: Array, R: Array) -> tuple[Array, Array]:
        """z - h(x) of a camera pose (x, y, psi) and its covariance S."""
        return pose_residual(pose, self.x[POSE]), self.P[POSE, POSE] + R

    def correct(self, pose: Array, R: Array) -> None:
        """Update with a camera pose (x, y, psi) [m, m, rad]."""
        self._filter.update(pose, lambda _: H_CAMERA, lambda x: x[POSE], R, residual=pose_residual)
        self.x[2] = math.remainder(self.x[2], 2.0 * math.pi)

    @staticmethod
    def _coasting_jacobian(dt: float) -> Array:
        F = np.eye(SIZE)
        F[0, 3] = F[1, 4] = dt
        return F

    @classmethod
    def _jacobian(cls, dt: float, R: Array, accel: Array) -> Array:
        F = cls._coasting_jacobian(dt)
        turned = np.array([-accel[1], accel[0]])  # d accel / d psi
        F[2, 5] = -dt
        F[0:2, 2], F[3:5, 2] = 0.5 * dt * dt * turned, dt * turned
        F[0:2, 6:8], F[3:5, 6:8] = -0.5 * dt * dt * R, -dt * R
        return F

    def _process_noise(self, dt: float, known: bool) -> Array:
        n = self._noise
        rate, accel = (n.gyro_noise, n.accel_noise) if known else (n.coasting_yaw_rate, n.coasting_accel)
        correlation = dt * SAMPLE_PERIOD * (1.0 if known else COASTING_SAMPLES)
        Q = np.zeros(SIZE)
        Q[2] = rate**2 * correlation
        Q[3:5] = accel**2 * correlation
        Q[0:2] = Q[3:5] * dt * dt / 3.0
        Q[5] = n.gyro_drift**2 * dt
        Q[6:8] = n.accel_drift**2 * dt
        return np.diag(Q)


def pose_residual(z: Array, predicted: Array) -> Array:
    """Difference of two poses, the heading's the short way round."""
    y = z - predicted
    y[2] = math.remainder(y[2], 2.0 * math.pi)
    return y
