# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Heading from gyro and orientation."""

import numpy as np
import pytest

from fish_control.imu_heading import HeadingNoise, ImuHeading

NOISE = HeadingNoise(gyro=0.006, gyro_drift=1e-4, unknown_rate=2.0, reach=0.1)


def swing(t):
    return 0.2 * np.sin(12.6 * t) + 0.1 * t


def run(gyro_scale=1.0, bias=0.0, use_gyro=True, use_yaw=True, seconds=20.0):
    """RMS of the heading's changes against the truth after 5 s, and the filter."""
    rng, heading, rows = np.random.default_rng(1), ImuHeading(NOISE), []
    for k in range(int(100 * seconds)):
        t = 0.01 * k
        rate = (swing(t + 1e-5) - swing(t - 1e-5)) / 2e-5
        gyro = gyro_scale * rate + bias + rng.normal(0, 0.006) if use_gyro else None
        yaw = np.angle(np.exp(1j * (swing(t) + 2.5))) + rng.normal(0, 0.003) if use_yaw else None
        rows.append((t, heading.add(t, gyro, yaw).yaw - swing(t)))
    t, error = np.array(rows).T
    late = error[t > 5.0]
    return np.std(late), heading


def test_samples_exactly_as_far_apart_as_they_reach_measure_the_heading():
    heading = ImuHeading(NOISE)
    assert all(heading.add(0.1 * k, 1.0).known for k in range(100))


def test_a_good_gyro_smooths_the_orientation():
    spread, heading = run(bias=0.03)
    assert spread < 0.0015  # half of the orientation's noise
    assert heading.gyro_noise_ratio < 3.0


def test_a_gyro_that_contradicts_the_orientation_is_left():
    spread, heading = run(gyro_scale=0.6)
    assert spread < 0.01
    assert heading.gyro_noise_ratio > 5.0


def test_orientation_alone_and_gyro_alone():
    assert run(use_gyro=False)[0] < 0.005
    assert run(use_yaw=False)[0] < 0.01


def test_nothing_measured_is_nothing_known():
    heading = ImuHeading(NOISE)
    heading.add(0.0, None)
    step = heading.add(0.01, None)
    assert not step.known
    assert step.variance > 1e-4


def test_a_new_zero_of_the_orientation_does_not_turn_the_fish():
    heading = ImuHeading(NOISE)
    for k in range(200):
        step = heading.add(0.01 * k, 0.0, 0.3 if k < 100 else -2.0)
    assert step.yaw == pytest.approx(0.0, abs=1e-6)
