# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Strapdown motion model of the head: inertial measurements drive it, the camera corrects it.

State x = (p_x, p_y, psi, v_x, v_y, b_g, b_x, b_y): position [m] and heading [rad] in the pool, velocity over
ground in the pool frame [m/s], bias of the yaw rate [rad/s] and of both accelerometer axes [m/s^2].

    p' = v,   psi' = w - b_g,   v' = R(psi) (a - b)
    z_camera = (p_x, p_y, psi) + noise

w is the rate of the IMU's own heading, a the specific force in base_link; the pool is level and the fish swims upright, so
gravity has no share in the plane (what tilt adds is taken up by the biases). The rotor's swing of the head is in the
measurements. All samples between two moments are integrated at once (preintegration), in plain numbers: most intervals
have one to four steps, for which arrays cost many times as much.

The noises follow the data: one factor each for positions and headings (`NoiseScale`), and the model of the motion that
the poses bear out (`motion_models`). Without its accelerometer v' is white noise. A factor grows by GAIN in the logarithm with
every innovation that exceeds the quantile Q of its distribution and shrinks otherwise, so that a share of 1 - Q exceeds it: a
quantile, unlike a mean, does not care how far off an outlier is.
Sources: Titterton and Weston, Strapdown Inertial Navigation Technology, ch. 3, planar; Forster et al., On-manifold
preintegration, 2017, in the plane; stochastic quantile estimation (Robbins and Monro 1951).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fish_control.fusion_config import MotionNoise
from fish_control.imu_heading import COASTING_TIME, SAMPLE_PERIOD
from fish_control.imu_history import Step

Array = NDArray[np.float64]


QUANTILE = 0.7
CHI2 = {1: 1.074, 2: 2.408}  # quantiles by degrees of freedom
GAIN = 0.02
SMALLEST, LARGEST = 0.25, 400.0
POSITION, HEADING = slice(0, 2), slice(2, 3)


class NoiseScale:
    """Factors on all variances, of poses and of motion, that follow the innovations; 1 at first.

    Attributes:
        position, heading: on the variances of positions and headings.
    """

    def __init__(self) -> None:
        self.position = self.heading = 1.0

    def learn(self, y: Array, S: Array) -> None:
        """The innovation of a pose (x, y, psi) and its covariance with the present factors."""
        self.position = _follow(self.position, y[POSITION], S[POSITION, POSITION])
        self.heading = _follow(self.heading, y[HEADING], S[HEADING, HEADING])


def _follow(factor: float, y: Array, S: Array) -> float:
    step = GAIN * (float(_square(y.tolist(), S.tolist()) > CHI2[len(y)]) - (1.0 - QUANTILE))
    return min(max(factor * math.exp(step), SMALLEST), LARGEST)


def _square(y: list[float], S: list[list[float]]) -> float:
    """y S^-1 y of one or two numbers, by the cofactors of S."""
    if len(y) == 1:
        return y[0] * y[0] / S[0][0]
    (first, second), ((a, b), (_, c)) = y, S
    return (c * first * first - 2.0 * b * first * second + a * second * second) / (a * c - b * b)


SIZE = 8  # of the state


class Preintegration:
    """What the IMU's steps do to a state: the middle of each step counts for all of it.

    With dv = R(psi) (a - b) dt of a step and the time `left` after its middle, v moves by the sum of dv and p by the sum
    of left dv; the derivatives are sums too.

    Attributes:
        duration: s.
        turn: rad.
        dv, left_dv: sums (x, y) [m/s, m].
        parts: left, dv_x and dv_y of each step.
    """

    def __init__(self, x: Array, steps: Sequence[Step], accel_used: bool = True) -> None:
        """x: state at the start (8,); accel_used: False if the accelerometer drives nothing."""
        self.steps = steps
        self.duration = T = sum(step.dt for step in steps)
        _, _, psi, _, _, bias, bias_forward, bias_left = x.tolist()
        turn = since = known = dvx = dvy = left_dvx = left_dvy = 0.0
        since_dvx = since_dvy = both_dvx = both_dvy = 0.0  # sums of since dv and of left since dv
        along = left_along = across = left_across = (
            0.0  # sums of dt (c, s), which the biases move along
        )
        self.parts: list[tuple[float, float, float]] = []
        for dt, turned, _, forward, sideways, yaw_known, accel_known in steps:
            middle = since + 0.5 * dt
            left = T - middle
            turned = turned - bias * dt if yaw_known else 0.0  # without an IMU nothing is biased
            x_part = y_part = 0.0
            if accel_known and accel_used:
                angle = psi + turn + 0.5 * turned
                c, s = math.cos(angle) * dt, math.sin(angle) * dt
                ahead, aside = forward - bias_forward, sideways - bias_left
                x_part, y_part = c * ahead - s * aside, s * ahead + c * aside
                along, across = along + c, across + s
                left_along, left_across = left_along + left * c, left_across + left * s
            dvx, dvy = dvx + x_part, dvy + y_part
            left_dvx, left_dvy = left_dvx + left * x_part, left_dvy + left * y_part
            since_dvx, since_dvy = since_dvx + middle * x_part, since_dvy + middle * y_part
            both = left * middle
            both_dvx, both_dvy = both_dvx + both * x_part, both_dvy + both * y_part
            self.parts.append((left, x_part, y_part))
            turn, since = turn + turned, since + dt
            known += dt if yaw_known else 0.0
        self.turn, self.dv, self.left_dv = turn, (dvx, dvy), (left_dvx, left_dvy)
        self._since_dv, self._both_dv = (since_dvx, since_dvy), (both_dvx, both_dvy)
        self._along, self._left_along = (along, across), (left_along, left_across)
        self._known = known

    def jacobian(self) -> Array:
        """d x(end) / d x(start), (8, 8)."""
        (x, y), (left_x, left_y) = self.dv, self.left_dv
        (after_x, after_y), (both_x, both_y) = self._since_dv, self._both_dv
        (c, s), (left_c, left_s) = self._along, self._left_along
        T = self.duration
        return np.array(
            (
                (1.0, 0.0, -left_y, T, 0.0, both_y, -left_c, left_s),
                (0.0, 1.0, left_x, 0.0, T, -both_x, -left_s, -left_c),
                (0.0, 0.0, 1.0, 0.0, 0.0, -self._known, 0.0, 0.0),
                (0.0, 0.0, -y, 1.0, 0.0, after_y, -c, s),
                (0.0, 0.0, x, 0.0, 1.0, -after_x, -s, -c),
                (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
                (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
                (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            )
        )


# of the state when it starts: m, m, rad, m/s, m/s, rad/s, m/s^2, m/s^2
START_STD = (0.02, 0.02, 0.1, 0.2, 0.2, 0.05, 0.3, 0.3)
POSE, BIASES = slice(0, 3), slice(5, SIZE)
H_CAMERA = np.eye(3, SIZE)
# of the process noise: variances of p and v, their covariances, variances of the biases
NOISE_PLACES = np.ravel_multi_index(
    ((0, 1, 3, 4, 0, 3, 1, 4, 5, 6, 7), (0, 1, 3, 4, 3, 0, 4, 1, 5, 6, 7)), (SIZE, SIZE)
)


class MotionModel(NamedTuple):
    """How far the IMU is believed."""

    accel_used: bool  # whether the accelerometer drives the velocity
    accel_density: float  # m^2/s^3, of the noise of v'
    turn_factor: float  # on the variance of the IMU's turns

    @property
    def accel_noise(self) -> float:
        """The noise of v' as a standard deviation per sample at 100 Hz [m/s^2]."""
        return math.sqrt(self.accel_density / SAMPLE_PERIOD)


class StrapdownFilter:
    """filterpy's extended Kalman filter with the motion model above.

    Args:
        noise: its constants.
        scale: factors on the variances, which may change; all 1 without.

    Attributes:
        model: of the motion; the IMU as `noise` says it until another one is set.
    """

    def __init__(self, noise: MotionNoise, scale: NoiseScale | None = None) -> None:
        from filterpy.kalman import ExtendedKalmanFilter  # slow to import; fusion alone filters

        self._noise, self._scale = noise, scale or NoiseScale()
        self.model = MotionModel(True, noise.accel_noise**2 * SAMPLE_PERIOD, 1.0)
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

    def advance(self, steps: Sequence[Step]) -> None:
        """Predict over the IMU's steps, all at once."""
        x, moved = self.x, Preintegration(self.x, steps, self.model.accel_used)
        T = moved.duration
        x[0] += T * x[3] + moved.left_dv[0]
        x[1] += T * x[4] + moved.left_dv[1]
        x[2] = math.remainder(x[2] + moved.turn, 2.0 * math.pi)
        x[3] += moved.dv[0]
        x[4] += moved.dv[1]
        F = moved.jacobian()
        P = F @ self.P @ F.T + self._process_noise(moved)
        self._filter.P = 0.5 * (P + P.T)

    def innovation(self, pose: Array, R: Array) -> tuple[Array, Array]:
        """z - h(x) of a camera pose (x, y, psi) and its covariance S; R is scaled as the other noises are."""
        return pose_residual(pose, self.x[POSE]), self.P[POSE, POSE] + R

    def correct(self, pose: Array, R: Array, fade: float = 1.0) -> None:
        """Update with a camera pose (x, y, psi) [m, m, rad]; fade: multiplies the predicted covariance before.

        Biases are never less known than at the start: poses that do not tell them would let them grow without end.
        """
        growth = np.full(SIZE, math.sqrt(fade))
        known = np.array(START_STD)[BIASES] / np.sqrt(np.diagonal(self.P)[BIASES])
        growth[BIASES] = np.clip(growth[BIASES], None, np.maximum(known, 1.0))
        self._filter.P = growth[:, None] * self.P * growth
        self._filter.update(pose, lambda _: H_CAMERA, lambda x: x[POSE], R, residual=pose_residual)
        self.x[2] = math.remainder(self.x[2], 2.0 * math.pi)

    def _process_noise(self, moved: Preintegration) -> Array:
        n, Q = self._noise, np.zeros((SIZE, SIZE))
        used, density, heading_scale = self.model
        heading_scale *= self._scale.heading
        known = density * self._scale.position
        coasting = n.coasting_accel**2 * COASTING_TIME if used else known
        unknown_turn = n.coasting_yaw_rate**2 * COASTING_TIME
        speed = mixed = place = 0.0  # of v, v and p, p
        turns, moves = [], []  # variances, and what each turn moves: p, psi, v
        # a turn in one step turns the accelerations of all later ones, and half of its own
        after_x, after_y = -moved.dv[1], moved.dv[0]
        left_x, left_y = -moved.left_dv[1], moved.left_dv[0]
        for step, (left, dvx, dvy) in zip(moved.steps, moved.parts, strict=True):
            dt = step.dt
            q = dt * (known if step.accel_known else coasting)
            speed, mixed = speed + q, mixed + q * left
            place += q * (left * left + dt * dt / 12.0)
            half_x, half_y = -0.5 * dvy, 0.5 * dvx
            after_x, after_y = after_x - half_x, after_y - half_y
            left_x, left_y = left_x - left * half_x, left_y - left * half_y
            turn = unknown_turn * dt
            if step.yaw_known:
                turn = (step.yaw_variance + n.heading_drift**2 * dt) * heading_scale
            turns.append(turn)
            moves.append((left_x, left_y, 1.0, after_x, after_y))
            after_x, after_y = after_x - half_x, after_y - half_y
            left_x, left_y = left_x - left * half_x, left_y - left * half_y
        if moves:
            G = np.array(moves)
            Q[:5, :5] = (G.T * turns) @ G
        T = moved.duration
        drift = n.accel_drift**2 * T
        Q.ravel()[NOISE_PLACES] += (
            *(place, place, speed, speed),
            *(mixed, mixed, mixed, mixed),
            *(n.gyro_drift**2 * T, drift, drift),
        )
        return Q


def pose_residual(z: Array, predicted: Array) -> Array:
    """Difference of two poses, the heading's the short way round."""
    y = z - predicted
    y[2] = math.remainder(y[2], 2.0 * math.pi)
    return y
