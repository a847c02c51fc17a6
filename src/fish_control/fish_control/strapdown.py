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
    accel_noise: float = (
        0.15  # m/s^2 per sample; the sensor's 0.05, tilt, and the swing between samples
    )
    gyro_drift: float = 1e-4  # rad/s per sqrt(s), of the bias
    accel_drift: float = 1e-3  # m/s^2 per sqrt(s), of the biases
    coasting_yaw_rate: float = (
        2.0  # rad/s, unknown yaw rate without IMU (the head swings at up to 4 rad/s)
    )
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

    def advance(
        self, dt: float, before: InertialSample | None, after: InertialSample | None
    ) -> None:
        """Predict over dt [s] with the mean of the measurements at its ends; None: unknown."""
        known = before is not None and after is not None
        w = forward = left = 0.0
        x, F = self.x, np.eye(SIZE)
        if before is not None and after is not None:
            w = 0.5 * (before.yaw_rate + after.yaw_rate) - x[5]
            forward = 0.5 * (before.forward + after.forward) - x[6]
            left = 0.5 * (before.left + after.left) - x[7]
        psi = x[2] + 0.5 * w * dt
        c, s = math.cos(psi), math.sin(psi)
        ax, ay = c * forward - s * left, s * forward + c * left
        if known:
            _fill_jacobian(F, dt, c, s, ax, ay)
        else:
            F[0, 3] = F[1, 4] = dt
        x[0] += dt * x[3] + 0.5 * dt * dt * ax
        x[1] += dt * x[4] + 0.5 * dt * dt * ay
        x[2] = math.remainder(x[2] + w * dt, 2.0 * math.pi)
        x[3] += dt * ax
        x[4] += dt * ay
        P = F @ self.P @ F.T
        P.flat[:: SIZE + 1] += self._process_noise(dt, known)
        self._filter.P = P

    def innovation(self, pose: Array, R: Array) -> tuple[Array, Array]:
        """z - h(x) of a camera pose (x, y, psi) and its covariance S."""
        return pose_residual(pose, self.x[POSE]), self.P[POSE, POSE] + R

    def correct(self, pose: Array, R: Array) -> None:
        """Update with a camera pose (x, y, psi) [m, m, rad]."""
        self._filter.update(pose, lambda _: H_CAMERA, lambda x: x[POSE], R, residual=pose_residual)
        self.x[2] = math.remainder(self.x[2], 2.0 * math.pi)

    def _process_noise(self, dt: float, known: bool) -> tuple[float, ...]:
        """Diagonal of Q."""
        n = self._noise
        rate, accel = (
            (n.gyro_noise, n.accel_noise) if known else (n.coasting_yaw_rate, n.coasting_accel)
        )
        correlation = dt * SAMPLE_PERIOD * (1.0 if known else COASTING_SAMPLES)
        speed = accel**2 * correlation
        place, bias = speed * dt * dt / 3.0, n.accel_drift**2 * dt
        return place, place, rate**2 * correlation, speed, speed, n.gyro_drift**2 * dt, bias, bias


def _fill_jacobian(F: Array, dt: float, c: float, s: float, ax: float, ay: float) -> None:
    """d x(t + dt) / d x(t) into an identity; (c, s): direction of the head, (ax, ay): acceleration in the pool.

    Element by element: this runs for every IMU sample of a replay.
    """
    half = 0.5 * dt * dt
    F[0, 3] = F[1, 4] = dt
    F[2, 5] = -dt
    F[0, 2], F[1, 2], F[3, 2], F[4, 2] = (
        -half * ay,
        half * ax,
        -dt * ay,
        dt * ax,
    )  # d acceleration / d psi
    F[0, 6], F[0, 7], F[1, 6], F[1, 7] = -half * c, half * s, -half * s, -half * c
    F[3, 6], F[3, 7], F[4, 6], F[4, 7] = -dt * c, dt * s, -dt * s, -dt * c


def pose_residual(z: Array, predicted: Array) -> Array:
    """Difference of two poses, the heading's the short way round."""
    y = z - predicted
    y[2] = math.remainder(y[2], 2.0 * math.pi)
    return y
