# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The IMU's heading, its history, its lead, and the integration of its readings."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fish_control.fusion_config import MotionNoise
from fish_control.imu_heading import HeadingLead, HeadingNoise, ImuHeading, against_gyro
from fish_control.imu_history import CAPACITY, ImuHistory, InertialSample, Step
from fish_control.offset_sums import ClockEstimate
from fish_control.strapdown import SIZE, START_STD, StrapdownFilter, pose_residual

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


def heading(t):
    return 0.2 * np.sin(4.0 * np.pi * t) * (1.0 + 0.3 * np.sin(0.7 * t)) + 0.3 * np.sin(0.8 * t)


def sampled(lead, seed=0, period=0.05, seconds=30.0, gain=1.0, memory=math.inf):
    """The estimate from samples of a heading that leads the gyro by `lead` s; gain: of the gyro."""
    rng, estimate = np.random.default_rng(seed), HeadingLead(0.1, memory)
    for t in np.cumsum(rng.uniform(0.6, 1.4, round(seconds / period)) * period):
        rate = (heading(t + 1e-4) - heading(t - 1e-4)) / 2e-4
        yaw = heading(t + lead) + rng.normal(0.0, 0.01)
        estimate.add(float(t), gain * rate + rng.normal(0.0, 0.1), float(yaw))
    return estimate


@pytest.mark.parametrize("lead", [-0.04, 0.0, 0.012, 0.05])
@pytest.mark.parametrize("gain", [1.0, 0.75])
def test_the_lead_is_found(lead, gain):
    found = sampled(lead, gain=gain).current
    assert found.sure
    assert found.offset == pytest.approx(lead, abs=0.004)


def test_errors_are_as_large_as_the_standard_deviation_says():
    found = [sampled(0.012, seed).current for seed in range(30)]
    ratios = np.array([(e.offset - 0.012) / e.std for e in found])
    assert 0.3 < np.sqrt(np.mean(ratios**2)) < 1.6


def test_a_lead_that_changes_is_followed_within_the_memory():
    estimate = HeadingLead(0.1, 5.0)
    for k in range(6000):
        t = 0.01 * k
        lead = 0.0 if t < 30.0 else 0.03
        estimate.add(
            t, float((heading(t + 1e-4) - heading(t - 1e-4)) / 2e-4), float(heading(t + lead))
        )
    assert estimate.current.offset == pytest.approx(0.03, abs=0.002)


def test_a_fish_at_rest_tells_no_lead():
    estimate, rng = HeadingLead(0.1), np.random.default_rng(1)
    for k in range(2000):
        estimate.add(0.01 * k, rng.normal(0.0, 0.006), rng.normal(0.0, 0.003))
    assert not estimate.current.sure


@pytest.mark.parametrize("gyro", ["absent", "in samples too far apart"])
def test_a_gyro_that_does_not_say_what_happened_tells_no_lead(gyro):
    estimate, period = HeadingLead(0.1), 0.01 if gyro == "absent" else 0.11
    for k in range(1000):
        t = period * k
        rate = None if gyro == "absent" else float((heading(t + 1e-4) - heading(t - 1e-4)) / 2e-4)
        estimate.add(t, rate, float(heading(t)))
    assert not estimate.current.sure


def test_the_offset_to_the_gyro_is_known_as_well_as_both_parts():
    to_gyro = against_gyro(ClockEstimate(-0.505, 0.003, True), ClockEstimate(0.012, 0.004, True))
    assert to_gyro.offset == pytest.approx(-0.493)
    assert to_gyro.std == pytest.approx(0.005)
    assert to_gyro.sure
    assert not against_gyro(ClockEstimate(0.0, 0.1, False), ClockEstimate(0.0, 0.001, True)).sure


def started(x):
    filter = StrapdownFilter(MotionNoise())
    filter.set(np.asarray(x, dtype=float), np.eye(SIZE) * 1e-4)
    return filter


def interval(T, yaw, accel, steps=200, known=True):
    """`yaw` and `accel` are functions of the time since the start."""
    t = np.linspace(0.0, T, steps + 1)
    psi, force = [yaw(s) for s in t], np.array([accel(s) for s in t])
    mean = 0.5 * (force[1:] + force[:-1])
    return [
        Step(T / steps, psi[k + 1] - psi[k], 1e-8, *map(float, mean[k]), known, known)
        for k in range(steps)
    ]


def wild(T=0.5, steps=50):
    return interval(
        T,
        lambda s: 0.3 * np.sin(9.0 * s),
        lambda s: (0.4 + s, -0.6 * np.cos(7.0 * s)),
        steps,
    )


def test_circle_at_constant_speed():
    u, r, T = 0.2, 0.8, 2.0
    filter = started([0, 0, 0, u, 0, 0, 0, 0])
    filter.advance(interval(T, lambda s: r * s, lambda s: (0.0, u * r)))  # centripetal
    radius = u / r
    expected = [radius * np.sin(r * T), radius * (1 - np.cos(r * T)), r * T]
    np.testing.assert_allclose(filter.x[:3], expected, atol=2e-5)
    assert np.hypot(*filter.x[3:5]) == pytest.approx(u, rel=1e-4)


def test_biases_are_taken_off():
    filter = started([0, 0, 0.3, 0.1, 0.0, 0.02, 0.1, -0.2])
    filter.advance(interval(1.0, lambda s: 0.02 * s, lambda s: (0.1, -0.2)))
    along = 0.1 * np.ones(1)
    np.testing.assert_allclose(filter.x[:5], [along[0], 0.0, 0.3, 0.1, 0.0], atol=1e-12)


def test_all_samples_at_once_are_as_one_after_the_other():
    x, P = np.array([0.1, -0.2, 0.7, 0.2, -0.1, 0.01, 0.05, -0.03]), np.eye(SIZE) * 1e-3
    together, stepwise = started(x), started(x)
    together.set(x, P)
    stepwise.set(x, P)
    whole = wild()
    together.advance(whole)
    for step in whole:
        stepwise.advance([step])
    np.testing.assert_allclose(together.x, stepwise.x, atol=1e-9)
    np.testing.assert_allclose(together.P, stepwise.P, rtol=2e-2, atol=1e-6)


def test_covariance_moves_with_the_numeric_jacobian():
    x = np.array([0.1, -0.2, 0.7, 0.2, -0.1, 0.01, 0.05, -0.03])

    def moved(state):
        filter = started(state)
        filter.advance(wild())
        return filter.x.copy()

    F = np.column_stack([(moved(x + d) - moved(x - d)) / 2e-6 for d in np.eye(SIZE) * 1e-6])
    filter = started(x)
    P = np.diag(np.arange(1.0, 9.0)) * 1e-2
    filter.set(x, P)
    filter.advance(wild())
    grown = filter.P - F @ P @ F.T
    np.testing.assert_allclose(grown, 0.0, atol=1e-4)
    assert np.linalg.eigvalsh(grown).min() > -1e-9  # what is left is noise


def test_without_imu_the_motion_goes_on_and_trust_fades():
    filter = started([0, 0, 0.5, 0.2, 0.0, 0.3, 0, 0])
    filter.advance(interval(0.5, lambda s: 0.0, lambda s: (9.0, 9.0), known=False))
    np.testing.assert_allclose(filter.x[:3], [0.1, 0.0, 0.5], atol=1e-9)
    assert np.sqrt(filter.P[2, 2]) > 0.3


def test_a_pose_that_is_doubted_less_than_the_motion_moves_the_estimate():
    trusting, doubting = started(np.zeros(SIZE)), started(np.zeros(SIZE))
    R, pose = np.eye(3) * 1e-4, np.array([0.1, 0.0, 0.0])
    trusting.correct(pose, R)
    doubting.correct(pose, R, fade=100.0)
    assert trusting.x[0] == pytest.approx(0.05)
    assert doubting.x[0] == pytest.approx(0.1 * 100.0 / 101.0)


def test_correction_turns_the_short_way():
    filter = started([0, 0, np.pi - 0.01, 0, 0, 0, 0, 0])
    filter.correct(np.array([0.0, 0.0, -np.pi + 0.01]), np.eye(3) * 1e-6)
    assert abs(filter.x[2]) == pytest.approx(np.pi - 0.01, abs=1e-3)
    assert filter.x[2] < 0.0


def test_residual_of_headings():
    np.testing.assert_allclose(
        pose_residual(np.array([1, 2, 3.0]), np.array([0, 0, -3.0])), [1, 2, 6 - 2 * np.pi]
    )


def test_doubts_again_and_again_leave_a_covariance_that_can_be_used():
    """Without the accelerometer no pose tells its biases: each doubt multiplies what is not known of them."""
    filter = started(np.zeros(SIZE))
    filter.model = filter.model._replace(accel_used=False)
    for _ in range(40):
        filter.advance(interval(0.03, lambda s: 0.0, lambda s: (0.1, -0.2), steps=3))
        filter.correct(np.zeros(3), np.diag([1e-6, 1e-6, 1e-4]), fade=30.0)
    assert np.all(np.sqrt(np.diagonal(filter.P)[5:]) <= np.array(START_STD[5:]) * 1.01)
    assert np.linalg.eigvalsh(filter.P).min() > 0.0
