# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Quaternions against rotation matrices."""

import math
import random

import numpy as np
import pytest

from fish_hw.devices.imu_sample import (
    ImuSample,
    Mounting,
    from_yaw_pitch_roll,
    mean_rate,
    multiply,
    norm,
    rotate,
)
from fish_hw.settings import ImuSettings


def matrix(yaw: float, pitch: float, roll: float) -> np.ndarray:
    cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (math.cos, math.sin))
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return z @ y @ x


def random_angles(generator: random.Random) -> tuple[float, float, float]:
    return generator.uniform(-3, 3), generator.uniform(-1.5, 1.5), generator.uniform(-3, 3)


def test_rotation_equals_the_matrix():
    generator = random.Random(0)
    for _ in range(50):
        a, b = random_angles(generator), random_angles(generator)
        v = (generator.gauss(0, 1), generator.gauss(0, 1), generator.gauss(0, 1))
        q = multiply(from_yaw_pitch_roll(*a), from_yaw_pitch_roll(*b))
        assert norm(q) == pytest.approx(1.0)
        assert rotate(q, v) == pytest.approx(matrix(*a) @ matrix(*b) @ v)


def test_mean_rate_of_a_steady_turn():
    generator = random.Random(1)
    for _ in range(50):
        q = from_yaw_pitch_roll(*random_angles(generator))
        w = np.array([generator.gauss(0, 3) for _ in range(3)])
        dt, angle = 0.01, np.linalg.norm(w) * 0.01
        step = (*(w / np.linalg.norm(w) * math.sin(angle / 2)), math.cos(angle / 2))
        later = multiply(q, step)
        assert mean_rate(q, later, dt) == pytest.approx(w)
        assert mean_rate(q, tuple(-c for c in later), dt) == pytest.approx(w)
    level = from_yaw_pitch_roll(0.4, 0.0, 0.0)
    for still in (q, level):
        assert mean_rate(still, still, dt) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_mounting_turns_everything_into_base_axes():
    mount = (0.7, -0.2, math.pi - 0.1)
    settings = ImuSettings(mount_yaw=mount[0], mount_pitch=mount[1], mount_roll=mount[2])
    R_base_sensor = matrix(*mount)
    level_base = (0.4, 0.1, -0.3)
    R_level_sensor = matrix(*level_base) @ R_base_sensor
    w, a = np.array([0.1, 0.2, 0.3]), np.array([1.0, -2.0, 9.0])
    # quaternion of the sensor by its columns, made with an independent formula
    x, y, z, s = (
        1.015 * c for c in _quaternion(R_level_sensor)
    )  # as far from 1 as a reading may be
    sample = Mounting(settings).to_base(ImuSample(1.0, (x, y, z, s), tuple(w), tuple(a), 3))
    assert norm(sample.orientation) == pytest.approx(1.0)
    assert sample.angular_velocity == pytest.approx(R_base_sensor @ w)
    assert sample.acceleration == pytest.approx(R_base_sensor @ a)
    for axis in np.eye(3):
        assert rotate(sample.orientation, tuple(axis)) == pytest.approx(matrix(*level_base) @ axis)


def _quaternion(R: np.ndarray) -> tuple[float, float, float, float]:
    """Eigenvector of the rotation with eigenvalue 1, and its angle."""
    values, vectors = np.linalg.eig(R)
    axis = np.real(vectors[:, np.argmin(abs(values - 1))])
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    angle = math.atan2(axis @ skew, (np.trace(R) - 1) / 2)
    return (*(axis * math.sin(angle / 2)), math.cos(angle / 2))
