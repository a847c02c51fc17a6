"""Strapdown motion model of the head: inertial measurements drive it, the camera corrects it.

State x = (p_x, p_y, psi, v_x, v_y, b_g, b_x, b_y): position [m] and heading [rad] in the pool, velocity over
ground in the pool frame [m/s], bias of the gyro [rad/s] and of both accelerometer axes [m/s^2].

    p' = v,   psi' = w - b_g,   v' = R(psi) (a - b)
    z_camera = (p_x, p_y, psi) + noise

a is the specific force in base_link; the pool is level and the fish swims upright, so gravity has no share in
the plane (what tilt adds is taken up by the biases). The swing of the head is in the measurements and needs
no model.
Source: Titterton and Weston, Strapdown Inertial Navigation Technology, ch. 3, planar; noise values:
    RECORDING.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

Array = NDArray[np.float64]
SIZE = 8
POSE = slice(0, 3)
H_CAMERA = np.eye(3, SIZE)


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations of the motion model."""

    gyro_noise: float = (
        0.02  # rad/s for each sample at 100 Hz; the sensor's 0.006 and the swing between samples
    )
    accel_noise: float = (
        0.15  # m/s^2 for each sample at 100 Hz; the sensor's 0.05, tilt, and the swing between samples
    )
    gyro_drift: float = 1e-4  # rad/s per sqrt(s), of the bias
    accel_drift: float = 1e-3  # m/s^2 per sqrt(s), of the biases
    coasting_yaw_rate: float = (
        2.0  # rad/s, unknown yaw rate while there is no IMU (the head swings at up to 4 rad/s)
    )
    coasting_accel: float = 1.0  # m/s^2, unknown acceleration while there is no IMU


@dataclass(frozen=True)
class InertialSample:
    """One IMU measurement in base_link; `known` is False where there was none."""

    yaw_rate: float  # rad/s
    forward: float  # m/s^2, specific force
    left: float  # m/s^2
    known: bool = True


SAMPLE_PERIOD = 0.01  # s, for which the noises of MotionNoise are given


class StrapdownFilter(ExtendedKalmanFilter):
    """filterpy's extended Kalman filter with the motion model above."""

    def __init__(self, noise: MotionNoise) -> None:
        super().__init__(dim_x=SIZE, dim_z=3)
        self.x = np.zeros(SIZE)
        self._noise = noise

    def advance(self, dt: float, before: InertialSample, after: InertialSample) -> None:
        """Predict over dt [s] with the mean of the measurements at its ends."""
        known = before.known and after.known
        w = 0.5 * (before.yaw_rate + after.yaw_rate) - self.x[5] if known else 0.0
        a_x = 0.5 * (before.forward + after.forward) - self.x[6] if known else 0.0
        a_y = 0.5 * (before.left + after.left) - self.x[7] if known else 0.0
        psi = self.x[2] + 0.5 * w * dt
        c, s = math.cos(psi), math.sin(psi)
        accel = np.array([c * a_x - s * a_y, s * a_x + c * a_y])
        self.F = self._jacobian(dt, c, s, accel, known)
        self.Q = self._process_noise(dt, known)
        self.x[0:2] += dt * self.x[3:5] + 0.5 * dt * dt * accel
        self.x[2] = math.remainder(self.x[2] + w * dt, 2.0 * math.pi)
        self.x[3:5] += dt * accel
        self.P = self.F @ self.P @ self.F.T + self.Q

    def innovation(self, pose: Array, R: Array) -> tuple[Array, Array]:
        """z - h(x) of a camera pose (x, y, psi) and its covariance S."""
        return pose_residual(pose, self.x[POSE]), self.P[POSE, POSE] + R

    def correct(self, pose: Array, R: Array) -> None:
        """Update with a camera pose (x, y, psi) [m, m, rad]."""
        self.update(pose, lambda _: H_CAMERA, lambda x: x[POSE], R, residual=pose_residual)
        self.x[2] = math.remainder(self.x[2], 2.0 * math.pi)

    @staticmethod
    def _jacobian(dt: float, c: float, s: float, accel: Array, known: bool) -> Array:
        F = np.eye(SIZE)
        F[0, 3] = F[1, 4] = dt
        if known:
            turned = np.array([-accel[1], accel[0]])  # d accel / d psi
            R = np.array([[c, -s], [s, c]])
            F[2, 5] = -dt
            F[0:2, 2], F[3:5, 2] = 0.5 * dt * dt * turned, dt * turned
            F[0:2, 6:8], F[3:5, 6:8] = -0.5 * dt * dt * R, -dt * R
        return F

    def _process_noise(self, dt: float, known: bool) -> Array:
        n = self._noise
        rate, accel = (n.gyro_noise, n.accel_noise) if known else (n.coasting_yaw_rate, n.coasting_accel)
        white = dt * SAMPLE_PERIOD
        swing = 1.0 if known else 10.0  # samples over which what coasting does not know keeps its sign
        Q = np.zeros(SIZE)
        Q[2] = rate**2 * white * swing
        Q[3:5] = accel**2 * white * swing
        Q[0:2] = Q[3:5] * dt * dt / 3.0
        Q[5] = n.gyro_drift**2 * dt
        Q[6:8] = n.accel_drift**2 * dt
        return np.diag(Q)


def pose_residual(z: Array, predicted: Array) -> Array:
    """Difference of two poses, the heading's the short way round."""
    y = z - predicted
    y[2] = math.remainder(y[2], 2.0 * math.pi)
    return y
