"""What the IMU measured between its samples."""

import pytest

from fish_control.imu_history import ImuHistory, InertialSample


def history():
    imu = ImuHistory(reach=0.1)
    imu.add(1.0, InertialSample(0.5, 1.0, 2.0))
    imu.add(1.01, InertialSample(1.0, 3.0, 0.0))
    return imu


def test_between_samples_it_is_linear():
    assert history().at(1.0025) == pytest.approx((0.625, 1.5, 1.5))


def test_beyond_the_samples_the_nearest_holds_as_far_as_it_reaches():
    assert history().at(1.05) == (1.0, 3.0, 0.0)
    assert history().at(0.95) == (0.5, 1.0, 2.0)
    assert history().at(1.2) is None
    assert history().at(0.5) is None


def test_a_gap_longer_than_the_reach_is_unknown_in_its_middle():
    imu = history()
    imu.add(2.0, InertialSample(5.0, 0.0, 0.0))
    assert imu.at(1.5) is None
    assert imu.at(1.95).yaw_rate == 5.0


def test_forgotten_samples_are_gone():
    imu = history()
    imu.forget(1.005)
    assert imu.at(1.0) == (1.0, 3.0, 0.0)


def test_stamps_between_two_times_leave_those_two_out():
    imu = history()
    imu.add(1.02, InertialSample(0.0, 0.0, 0.0))
    assert imu.times(0.0, 2.0) == [1.0, 1.01, 1.02]
    assert imu.times(1.0, 1.02) == [1.01]
    assert imu.times(1.01, 1.02) == imu.times(1.02, 1.0) == []
