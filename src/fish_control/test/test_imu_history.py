# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the IMU measured between its samples."""

import numpy as np
import pytest

from fish_control.imu_history import CAPACITY, ImuHistory, InertialSample


def history():
    imu = ImuHistory(reach=0.1)
    imu.add(1.0, InertialSample(0.5, 2.0, 1.0, 2.0, 1e-6))
    imu.add(1.01, InertialSample(0.52, 3.0, 3.0, 0.0, 2e-6))
    return imu


def test_between_samples_it_is_linear():
    part = history().between(1.0025, 1.0075)
    np.testing.assert_allclose(part.time, [1.0025, 1.0075])
    np.testing.assert_allclose(part.yaw, [0.505, 0.515])
    np.testing.assert_allclose(part.accel, [[1.5, 1.5], [2.5, 0.5]])
    np.testing.assert_allclose(part.yaw_variance, [1e-6])  # half of a step
    assert part.yaw_known.all()
    assert part.accel_known.all()


def test_an_interval_is_cut_at_the_samples():
    imu = history()
    imu.add(1.02, InertialSample(0.5, 0.0, 0.0, 0.0, yaw_known=False, accel_known=False))
    part = imu.between(1.0, 1.015)
    np.testing.assert_allclose(part.time, [1.0, 1.01, 1.015])
    np.testing.assert_array_equal(part.yaw_known, [True, False])
    np.testing.assert_array_equal(part.accel_known, [True, False])


def test_beyond_the_newest_its_rate_holds_as_far_as_it_reaches():
    part = history().between(1.01, 1.05)
    np.testing.assert_allclose(np.diff(part.yaw), 3.0 * 0.04)
    assert part.yaw_known.all()
    assert not history().between(1.01, 1.2).yaw_known.any()


def test_a_gap_longer_than_the_reach_is_unknown():
    imu = history()
    imu.add(2.0, InertialSample(5.0, 0.0, 0.0, 0.0))
    np.testing.assert_array_equal(imu.between(1.005, 2.0).yaw_known, [True, False])
    assert imu.yaw_rate(1.5) is None
    assert imu.yaw_rate(1.95) == 0.0


def test_without_samples_nothing_is_known():
    part = ImuHistory(reach=0.1).between(1.0, 2.0)
    assert not part.yaw_known.any()
    assert not part.accel_known.any()


def test_the_newest_of_the_forgotten_stays():
    imu = history()
    imu.forget(1.005)
    assert imu.first_time == 1.0
    imu.forget(1.02)
    assert imu.first_time == imu.last_time == 1.01


@pytest.mark.parametrize("count", [CAPACITY, 3 * CAPACITY + 5])
def test_the_memory_has_an_end(count):
    imu = ImuHistory(reach=0.1)
    for k in range(count):
        imu.add(0.01 * k, InertialSample(0.02 * k, 2.0, 0.0, 0.0))
    assert len(imu) <= CAPACITY
    assert imu.last_time == pytest.approx(0.01 * (count - 1))
    np.testing.assert_allclose(np.diff(imu.times), 0.01, atol=1e-9)
    np.testing.assert_allclose(imu.heading(imu.times), 2.0 * imu.times, atol=1e-9)
