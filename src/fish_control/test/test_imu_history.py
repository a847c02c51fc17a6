# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the IMU measured between its samples."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fish_control.imu_history import CAPACITY, ImuHistory, InertialSample


def history():
    imu = ImuHistory(reach=0.1)
    imu.add(1.0, InertialSample(0.5, 2.0, 1.0, 2.0, 1e-6))
    imu.add(1.01, InertialSample(0.52, 3.0, 3.0, 0.0, 2e-6))
    return imu


def test_between_samples_it_is_linear():
    (step,) = history().between(1.0025, 1.0075)
    # yaw 0.505 to 0.515, forward 1.5 to 2.5, left 1.5 to 0.5; half of the variance
    assert step == pytest.approx((0.005, 0.01, 1e-6, 2.0, 1.0, True, True))


def test_an_interval_is_cut_at_the_samples():
    imu = history()
    imu.add(1.02, InertialSample(0.5, 0.0, 0.0, 0.0, yaw_known=False, accel_known=False))
    steps = imu.between(1.0, 1.015)
    assert [step.dt for step in steps] == pytest.approx([0.01, 0.005])
    assert [step.yaw_known for step in steps] == [True, False]
    assert [step.accel_known for step in steps] == [True, False]


def test_beyond_the_newest_its_rate_holds_as_far_as_it_reaches():
    for begin in (1.01, 1.02):
        (step,) = history().between(begin, 1.05)
        assert step.turn == pytest.approx(3.0 * (1.05 - begin))
        assert step.yaw_known
    assert not history().between(1.01, 1.2)[0].yaw_known


def test_before_the_first_its_values_hold():
    before, after = history().between(0.95, 1.005)
    assert before == pytest.approx((0.05, 0.0, 1e-6, 1.0, 2.0, True, True))
    assert after == pytest.approx((0.005, 0.01, 1e-6, 1.5, 1.5, True, True))


@settings(suppress_health_check=[HealthCheck.too_slow])  # a busy computer is no failure
@given(st.floats(0.99, 1.06), st.floats(1e-4, 0.05), st.floats(0.0, 1.0))
def test_two_parts_make_the_whole(start, length, share):
    imu = history()
    imu.add(1.03, InertialSample(0.6, -1.0, 0.5, 0.3, 3e-6))
    cut = start + share * length
    whole = imu.between(start, start + length)
    parts = (
        [*imu.between(start, cut), *imu.between(cut, start + length)] if 0 < share < 1 else whole
    )
    for name in ("dt", "turn"):
        total = sum(getattr(step, name) for step in whole)
        assert sum(getattr(step, name) for step in parts) == pytest.approx(total, abs=1e-12)


def test_a_gap_longer_than_the_reach_is_unknown():
    imu = history()
    imu.add(2.0, InertialSample(5.0, 0.0, 0.0, 0.0))
    assert [step.yaw_known for step in imu.between(1.005, 2.0)] == [True, False]
    assert imu.yaw_rate(1.5) is None
    assert imu.yaw_rate(1.95) == 0.0


def test_gaps_tell_between_which_times_the_heading_was_measured():
    imu = history()
    imu.add(1.02, InertialSample(0.5, 0.0, 0.0, 0.0, yaw_known=False))
    imu.add(2.02, InertialSample(5.0, 0.0, 0.0, 0.0))
    imu.add(2.03, InertialSample(5.0, 0.0, 0.0, 0.0))
    gaps = imu.gaps(np.array([0.99, 1.0, 1.005, 1.01, 1.015, 1.02, 1.52, 2.02, 2.03, 2.04]))
    np.testing.assert_allclose(gaps, [np.nan, 0.0, 0.0, 0.0, 0.5, 1.0, 1.5, 2.0, 2.0, np.nan])


def test_without_samples_nothing_is_known():
    (step,) = ImuHistory(reach=0.1).between(1.0, 2.0)
    assert step == (1.0, 0.0, 0.0, 0.0, 0.0, False, False)


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


def test_an_imu_away_from_the_centre_of_mass_gives_the_centre_s_acceleration():
    """A head that swings about a centre of mass at rest: all that the IMU feels is its own motion on the lever."""
    place, w, swing = np.array([0.06, -0.02]), 2.0 * np.pi * 2.0, 0.3  # m, rad/s, rad
    imu = ImuHistory(reach=0.1, place=tuple(place))
    bare = ImuHistory(reach=0.1)
    for t in np.arange(0.0, 1.0, 0.01):
        yaw, rate = swing * np.sin(w * t), swing * w * np.cos(w * t)
        alpha = -swing * w**2 * np.sin(w * t)
        felt = alpha * np.array([-place[1], place[0]]) - rate**2 * place
        for history in (imu, bare):
            history.add(float(t), InertialSample(float(yaw), float(rate), *map(float, felt)))
    forces = np.array([step[3:5] for step in imu.between(0.1, 0.9)])
    felt = np.array([step[3:5] for step in bare.between(0.1, 0.9)])
    assert np.abs(felt).max() > 2.0
    assert np.abs(forces).max() < 0.01 * np.abs(felt).max()
