# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Samples of the IMU: quaternions against rotation matrices; samples that cannot be used are told from a fish that swims hard,
and from a hit.
"""

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from fish_hw.devices.imu_plausibility import ImuPlausibility
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

DT = 0.01
FREQUENCY = 2.0 * math.tau  # rad/s


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


def swimming(count: int, rate: float = 5.3) -> list[ImuSample]:
    """Yaw in strokes of 2 Hz with the highest turn rate of the trials [rad/s]."""
    samples = []
    for k in range(count):
        t = k * DT
        yaw = rate / FREQUENCY * math.sin(FREQUENCY * t)
        samples.append(
            ImuSample(
                t,
                (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
                (0.0, 0.0, rate * math.cos(FREQUENCY * t)),
                (1.8 * math.cos(FREQUENCY * t), 1.8 * math.sin(FREQUENCY * t), 9.81),
                3,
            )
        )
    return samples


def used(samples: list[ImuSample], check: ImuPlausibility | None = None) -> list[bool]:
    check = check or ImuPlausibility(DT)
    return [check.use(sample) for sample in samples]


@pytest.mark.parametrize("rate", [0.1, 5.3])
def test_a_swimming_fish_is_believed(rate):
    assert all(used(swimming(500, rate)))


def test_a_gyroscope_that_reads_a_third_too_little_is_believed():
    """As in the recordings of the real robot."""
    low = [
        replace(s, angular_velocity=(0.0, 0.0, 0.65 * s.angular_velocity[2])) for s in swimming(500)
    ]
    assert all(used(low))


def test_values_that_stand_still_are_not_used():
    samples, check = swimming(100), ImuPlausibility(DT)
    frozen = samples[:50] + [replace(samples[49], time_s=s.time_s) for s in samples[50:]]
    assert used(frozen, check) == [True] * 50 + [False] * 50
    assert check.trouble == "values stand still"


@pytest.mark.parametrize(
    "flip",
    [
        lambda s: replace(s, angular_velocity=(0.0, 0.0, s.angular_velocity[2] + 8.0)),
        lambda s: replace(s, angular_velocity=(-16.0, 0.0, s.angular_velocity[2])),
        lambda s: replace(s, acceleration=(s.acceleration[0] + 32.0, *s.acceleration[1:])),
        lambda s: replace(s, orientation=(0.0, 0.0, 1.0, 0.0)),
    ],
    ids=["yaw rate", "roll rate", "acceleration", "orientation"],
)
def test_a_bit_error_within_the_sensors_range_costs_its_sample(flip):
    samples = swimming(200)
    for k in range(20, 200, 20):
        samples[k] = flip(samples[k])
    kept = used(samples)
    assert not any(kept[k] for k in range(20, 200, 20))
    assert sum(kept) > 200 - 9 * 13  # an orientation that jumps spoils its window


def test_a_turn_rate_that_steps_is_never_used_again_while_the_orientation_does_not_follow():
    samples, check = swimming(200), ImuPlausibility(DT)
    stepped = [
        replace(s, angular_velocity=(0.0, 0.0, s.angular_velocity[2] + 6.0)) for s in samples[100:]
    ]
    kept = used(samples[:100] + stepped, check)
    assert all(kept[:100])
    assert not any(kept[100:])
    assert "turn rate and orientation disagree by 6." in check.trouble


def test_a_hit_that_turns_the_fish_is_believed_after_some_samples():
    """It turns at 6 rad/s from one sample to the next, and the orientation says so, too."""
    still = swimming(50, 0.01)
    hit = []
    for k in range(50):
        yaw = 6.0 * (k + 1) * DT
        hit.append(
            replace(
                still[0],
                time_s=still[-1].time_s + (k + 1) * DT,
                orientation=(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
                angular_velocity=(0.0, 0.0, 6.0 + 1e-3 * k),
            )
        )
    kept = used(still + hit)
    assert not kept[50]
    assert all(kept[60:])
