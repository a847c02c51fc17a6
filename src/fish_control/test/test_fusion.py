# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion of a swinging head seen by a late, lossy camera."""

import numpy as np
import pytest

from fish_control.estimate import LOST_VARIANCE
from fish_control.fusion import Fusion
from fish_control.fusion_config import FusionConfig
from fish_control.fusion_status import clock_values

DT = 0.01
W = 4.0 * np.pi
SWING, SPEED, TURN = 0.2, 0.2, 0.3  # rad, m/s, rad/s
FLIPPED = np.array([0.0, 0.0, np.pi])


def truth(t):
    """Pose, yaw rate and specific force of a head that swings at the rotor's frequency on a circular course."""
    course = TURN * t
    heading = course + SWING * np.sin(W * t)
    radius = SPEED / TURN
    pose = np.array([radius * np.sin(course), radius * (1 - np.cos(course)), heading])
    acceleration = SPEED * TURN * np.array([-np.sin(course), np.cos(course)])
    c, s = np.cos(heading), np.sin(heading)
    force = np.array([[c, s], [-s, c]]) @ acceleration
    return pose, TURN + SWING * W * np.cos(W * t), force


def measurements(seconds, seed=0, latency=0.08, gyro_bias=0.02, noisy=True):
    """(arrival, kind, stamp, values) in the order of arrival."""
    rng = np.random.default_rng(seed)
    noise = 1.0 if noisy else 0.0
    events = []
    for t in np.arange(0.0, seconds, DT):
        _, rate, force = truth(t)
        imu = [
            rate + gyro_bias + noise * rng.normal(0, 0.006),
            *(force + noise * rng.normal(0, 0.05, 2)),
        ]
        events.append((t, "imu", t, imu))
    for t in np.arange(0.003, seconds, 1.0 / 30.0):
        pose = truth(t)[0] + noise * rng.normal(0, [0.002, 0.002, 0.012])
        pose[2] = (pose[2] + np.pi) % (2 * np.pi) - np.pi
        events.append((t + latency + noise * rng.exponential(0.01), "camera", t, pose))
    return sorted(events, key=lambda e: e[0])


def true_pose(t, rest=1.0):
    """Pose of a fish that waits, then swims on a straight course with a swing whose amplitude and mean vary."""
    s = max(t - rest, 0.0)
    heading = 0.2 * np.sin(W * s) * (1.0 + 0.3 * np.sin(0.7 * s)) + 0.3 * np.sin(0.8 * s)
    return np.array([0.2 * (s - 1.0 + np.exp(-s)), 0.0, heading])


def swum(seconds, latency=0.08, rest=1.0, seed=4):
    """As `measurements`, of `true_pose`."""
    rng, h, events = np.random.default_rng(seed), 1e-4, []
    for t in np.arange(0.0, seconds, DT):
        before, now, after = (true_pose(t + d, rest) for d in (-h, 0.0, h))
        acceleration = (after[:2] - 2.0 * now[:2] + before[:2]) / h**2
        c, s = np.cos(now[2]), np.sin(now[2])
        force = np.array([[c, s], [-s, c]]) @ acceleration + rng.normal(0, 0.05, 2)
        rate = (after[2] - before[2]) / (2.0 * h) + rng.normal(0, 0.006)
        events.append((t, "imu", t, [rate, *force]))
    for t in np.arange(0.003, seconds, 1.0 / 30.0):
        pose = true_pose(t, rest) + rng.normal(0, [0.002, 0.002, 0.012])
        events.append((t + latency, "camera", t, pose))
    return sorted(events, key=lambda e: e[0])


def feed(fusion, events):
    for _, kind, stamp, values in events:
        if kind == "imu":
            fusion.add_imu(stamp, *values)
        else:
            fusion.add_pose(stamp, values)


def pose_error(estimate):
    error = estimate.pose - truth(estimate.time)[0]
    error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi
    return error


@pytest.mark.parametrize("latency", [0.0, 0.08, 0.3])
def test_pose_and_velocity_of_a_swinging_head_in_spite_of_latency(latency):
    fusion, events = Fusion(), measurements(8.0, latency=latency)
    poses, twists = [], []
    for event in events:
        feed(fusion, [event])
        if event[1] == "imu" and event[0] > 3.0:
            estimate = fusion.estimate()
            pose, rate, _ = truth(estimate.time)
            swing = pose[2] - TURN * estimate.time
            poses.append(pose_error(estimate))
            twists.append(estimate.twist - [SPEED * np.cos(swing), -SPEED * np.sin(swing), rate])
    rmse = np.sqrt(np.mean(np.square(poses), axis=0))
    assert rmse[0] < 0.004
    assert rmse[1] < 0.004
    assert rmse[2] < 0.01
    assert np.all(np.sqrt(np.mean(np.square(twists), axis=0)) < [0.012, 0.012, 0.02])


def test_gyro_bias_is_found():
    fusion = Fusion()
    feed(fusion, measurements(10.0, gyro_bias=0.1))
    estimate = fusion.estimate()
    assert estimate.gyro_bias == pytest.approx(0.1, abs=0.004)
    assert estimate.twist[2] == pytest.approx(truth(estimate.time)[1], abs=0.03)  # and taken off


def test_errors_are_as_large_as_the_covariance_says():
    squares = []
    for seed in range(12):
        fusion = Fusion(FusionConfig(camera_position_noise=0.002, camera_heading_noise=0.012))
        feed(fusion, measurements(5.0, seed=seed))
        estimate = fusion.estimate()
        error = pose_error(estimate)
        squares.append(error @ np.linalg.solve(estimate.pose_covariance, error))
    assert (
        0.5 < np.mean(squares) < 6.0
    )  # chi^2 of 3 has mean 3; the model's noise is on the safe side


def test_order_of_arrival_makes_no_difference():
    events = measurements(4.0, noisy=False)
    rng = np.random.default_rng(5)
    start = [e for e in events if e[2] < 1.0]
    rest = [e for e in events if e[2] >= 1.0]
    config = FusionConfig(estimate_offset=False)
    in_order, shuffled = Fusion(config), Fusion(config)
    feed(in_order, sorted(start, key=lambda e: e[2]) + sorted(rest, key=lambda e: e[2]))
    late = [
        (stamp + (rng.uniform(0.0, 0.5) if kind == "camera" else 0.0), kind, stamp, v)
        for _, kind, stamp, v in rest
    ]
    feed(shuffled, sorted(start, key=lambda e: e[2]) + sorted(late, key=lambda e: e[0]))
    a, b = in_order.estimate(), shuffled.estimate()
    assert shuffled.counts["pose"] == in_order.counts["pose"]
    np.testing.assert_allclose(a.pose, b.pose, atol=1e-4)  # what the noise factors learn differs


def test_flipped_headings_and_far_positions_are_refused():
    fusion, events, refused = Fusion(), measurements(6.0), 0
    rng = np.random.default_rng(6)
    for event in events:
        if event[1] == "camera" and event[2] > 1.0 and rng.random() < 0.2:
            wrong = FLIPPED if rng.random() < 0.5 else np.array([0.3, -0.2, 0.0])
            assert not fusion.add_pose(event[2], event[3] + wrong)
            refused += 1
        else:
            feed(fusion, [event])
    poses = sum(event[1] == "camera" for event in events)
    assert fusion.counts["pose_outlier"] == refused > 15
    assert fusion.counts["pose"] == poses - refused - fusion.config.start_frames
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.01, 0.01, 0.03])


def test_a_reflection_that_is_seen_now_and_then_is_never_believed():
    """It moves like the fish, so that its poses agree with each other for as long as one likes."""
    fusion = Fusion()
    for k, event in enumerate(measurements(6.0)):
        reflected = event[1] == "camera" and event[2] > 1.0 and k % 3 == 0
        feed(fusion, [(*event[:3], event[3] + [0.8, -0.5, 0.0]) if reflected else event])
    assert fusion.counts["pose_outlier"] > 30
    assert fusion.counts["reacquired"] == 0
    assert np.hypot(*pose_error(fusion.estimate())[:2]) < 0.01


def test_what_the_imu_said_before_the_first_pose_came_is_not_lost():
    fusion, estimate = Fusion(), None
    for event in measurements(1.0, latency=0.3, gyro_bias=0.0, noisy=False):
        feed(fusion, [event])
        estimate = estimate or fusion.estimate()
    assert estimate.time < 0.4
    assert np.all(np.abs(pose_error(estimate)) < [0.1, 0.1, 0.2])  # it is a third of a second on
    assert estimate.twist[2] == pytest.approx(truth(estimate.time)[1], abs=0.05)


def heading_errors(fusion, events):
    """Feed; (N, 3) of time, error of the heading and spread claimed, after every IMU sample."""
    rows = []
    for event in events:
        feed(fusion, [event])
        estimate = fusion.estimate()
        if event[1] == "imu" and estimate is not None and not estimate.camera_lost:
            rows.append(
                (event[0], pose_error(estimate)[2], np.sqrt(estimate.pose_covariance[2, 2]))
            )
    return np.array(rows)


@pytest.mark.parametrize("begin", [0.5, 0.6, 0.7, 0.8])
def test_late_poses_begin_where_the_imu_has_been_since(begin):
    fusion = Fusion()
    events = measurements(3.0, seed=7, latency=0.3, gyro_bias=0.0)
    _, error, spread = heading_errors(
        fusion, [e for e in events if e[1] == "imu" or e[2] > begin]
    ).T
    assert fusion.counts["started"] == 1
    assert fusion.counts["pose_outlier"] == 0
    assert np.abs(error).max() < 0.05
    assert spread.max() < 0.12


def test_late_poses_find_a_carried_fish_where_the_imu_has_been_since():
    fusion, moved = Fusion(), np.array([0.8, -0.5, 0.0])
    events = measurements(6.0, seed=7, latency=0.3)
    carried = [(*e[:3], e[3] + moved) if e[1] == "camera" and e[2] > 3.0 else e for e in events]
    time, error, spread = heading_errors(fusion, carried).T
    assert fusion.counts["reacquired"] == 1
    assert np.abs(error[time > 4.0]).max() < 0.05
    assert spread[time > 4.0].max() < 0.12


@pytest.mark.parametrize("gap", [0.15, 0.3, 0.5, 1.0, 60.0])
def test_when_both_sensors_were_silent_nobody_knows_what_happened_meanwhile(gap):
    """The IMU's last sample before and its first after say nothing about half a stroke or more in between."""
    fusion, events = Fusion(), measurements(5.0 + gap, seed=8, latency=0.0)
    _, error, spread = heading_errors(fusion, [e for e in events if not 3.0 < e[2] < 3.0 + gap]).T
    assert np.all(np.abs(error) < 5.0 * spread + 0.02)
    assert fusion.counts["pose_outlier"] <= 1  # the gate refuses one in a thousand
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.01, 0.01, 0.03])


@pytest.mark.parametrize("turn", [np.pi, 1.5, -1.5])
def test_a_wrong_heading_among_the_first_frames_does_not_start_the_filter(turn):
    fusion, seen = Fusion(), 0
    for event in measurements(2.0):
        if event[1] == "camera":
            seen += 1
            if seen <= 3:
                wrong = np.array([0.0, 0.0, turn if seen == 2 else 0.0])
                assert not fusion.add_pose(event[2], event[3] + wrong)
                continue
        feed(fusion, [event])
    assert abs(pose_error(fusion.estimate())[2]) < 0.05


def test_a_fish_that_was_carried_away_is_found_again():
    fusion, moved, bias = Fusion(), np.array([0.8, -0.5, 0.0]), None
    for event in measurements(10.0, gyro_bias=0.03):
        late = event[1] == "camera" and event[2] > 6.0
        feed(fusion, [(*event[:3], event[3] + moved) if late else event])
        if bias is None and fusion.counts["reacquired"]:
            found = fusion.estimate()
            bias, spread = found.gyro_bias, np.sqrt(found.twist_covariance[2, 2])
    assert fusion.counts["reacquired"] == 1
    np.testing.assert_allclose(pose_error(fusion.estimate())[:2], moved[:2], atol=0.01)
    assert bias == pytest.approx(0.03, abs=0.01)
    assert spread < 0.01


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite_are_counted_and_dropped(bad):
    fusion = Fusion()
    feed(fusion, measurements(2.0))
    before = fusion.estimate()
    assert not fusion.add_imu(2.0, bad, 0.0, 0.0)
    assert not fusion.add_pose(2.0, [0.0, bad, 0.0])
    assert not fusion.add_pose(2.0, [0.0, 0.0, 0.0], np.full((3, 3), bad))
    assert not fusion.add_imu(bad, 0.0, 0.0, 0.0)
    assert not fusion.add_pose(bad, truth(2.0)[0])
    assert fusion.counts["imu_not_finite"] == 2
    assert fusion.counts["pose_not_finite"] == 3
    np.testing.assert_array_equal(fusion.estimate().pose, before.pose)


@pytest.mark.parametrize("one_sided", [False, True])
@pytest.mark.parametrize("places", [(0, 1), (0, 2), (1, 2)])
def test_what_is_no_covariance_is_not_used(places, one_sided):
    """Parts that vary together more than each by itself, or numbers that are not symmetric, give negative variances."""
    fusion = Fusion()
    feed(fusion, measurements(2.0))
    before = fusion.estimate()
    R = np.diag([1e-5, 1e-5, 1e-4])
    R[places] = 1e-6 if one_sided else 1.0
    if not one_sided:
        R[places[::-1]] = 1.0
    assert not fusion.add_pose(2.0, [1.0, 1.0, 1.0], R)
    assert fusion.counts["pose_no_covariance"] == 1
    np.testing.assert_array_equal(fusion.estimate().pose, before.pose)


def test_parts_that_vary_wholly_together_are_used():
    """Single precision gives them an eigenvalue a little below 0."""
    fusion = Fusion()
    feed(fusion, measurements(2.0))
    along = np.array([1e-3, 2e-3, 0.5e-3], np.float32)
    assert fusion.add_pose(2.0, truth(2.0)[0], np.outer(along, along).astype(float))


@pytest.mark.parametrize("place", range(3))
def test_a_pose_of_which_a_part_is_not_measured_is_not_used(place):
    fusion = Fusion()
    feed(fusion, measurements(2.0))
    before = fusion.estimate()
    R = np.diag([1e-5, 1e-5, 1e-4])
    R[place, place] = -1.0
    assert not fusion.add_pose(2.0, [1.0, 1.0, 1.0], R)
    assert fusion.counts["pose_not_measured"] == 1
    np.testing.assert_array_equal(fusion.estimate().pose, before.pose)


@pytest.mark.parametrize(
    "wrong", [(60.5, 0, 0), (-12.5, 0, 0), (0, 136, 0), (0, 15, -15), (0, 3e38, 3e38)]
)
def test_one_damaged_imu_sample_neither_moves_the_pose_nor_locks_the_camera_out(wrong):
    """Such values pass the driver; one had moved the pose by up to 1.5 m, and the camera was an outlier for a second."""
    fusion, errors = Fusion(), []
    for event in measurements(4.0, seed=1):
        if event[1] == "imu" and event[2] == pytest.approx(2.0):
            assert not fusion.add_imu(event[2], *wrong)
            continue
        feed(fusion, [event])
        if event[0] > 1.0:
            errors.append(np.abs(pose_error(fusion.estimate())))
    assert fusion.counts["imu_implausible"] == 1
    assert fusion.counts["pose_outlier"] == 0
    assert fusion.counts["reacquired"] == 0
    assert np.all(np.max(errors, axis=0) < [0.015, 0.015, 0.05])
    assert not fusion.estimate().imu_lost


def test_what_a_fish_does_is_no_damage_and_the_bounds_are_parameters():
    """The fastest of the real trials, with room."""
    assert Fusion().add_imu(1.0, 6.0, 2.0, -2.0)
    fusion = Fusion(FusionConfig(largest_accel=1.0, largest_yaw_rate=30.0))
    assert fusion.add_imu(1.0, 25.0, 0.0, 0.0)
    assert not fusion.add_imu(1.01, 0.0, 0.8, 0.8)


def test_an_imu_that_only_says_what_cannot_be_is_lost():
    fusion = Fusion()
    for event in measurements(4.0):
        damaged = event[1] == "imu" and event[2] > 2.0
        feed(fusion, [(*event[:3], [100.0, 0.0, 0.0]) if damaged else event])
    assert fusion.estimate().imu_lost
    assert not fusion.estimate().camera_lost
    assert np.hypot(*pose_error(fusion.estimate())[:2]) < 0.05


def test_too_late_and_repeated_measurements_are_dropped():
    fusion = Fusion()
    feed(fusion, measurements(3.0))
    assert not fusion.add_pose(0.5, truth(0.5)[0])
    assert not fusion.add_imu(2.905, 0.0, 0.0, 0.0)
    assert fusion.counts["pose_too_late"] == 1
    assert fusion.counts["imu_out_of_order"] == 1
    assert fusion.add_imu(3.0, 0.0, 0.0, 0.0)
    assert fusion.counts["imu"] == 301


def test_a_camera_that_comes_back_cannot_speak_of_what_is_longer_ago_than_the_history():
    fusion = Fusion()
    feed(fusion, [e for e in measurements(5.0) if e[1] == "imu" or e[2] < 2.0])
    assert not fusion.add_pose(2.9, truth(2.9)[0])
    assert fusion.counts["pose_too_late"] == 1
    assert fusion.add_pose(4.1, truth(4.1)[0])


def test_lost_camera_is_said_in_the_covariance_and_passes():
    fusion, events = Fusion(), measurements(6.0)
    rows = []
    for event in events:
        if event[1] == "camera" and 2.0 < event[2] < 4.0:
            continue
        feed(fusion, [event])
        estimate = fusion.estimate()
        if event[1] == "imu" and estimate is not None:
            error, P = pose_error(estimate), estimate.pose_covariance
            nees = error @ np.linalg.solve(P, error)
            rows.append((event[0], estimate.camera_lost, P[0, 0], nees))
    time, lost, variance, nees = np.array(rows).T
    silent = (time > 2.1) & (time < 4.05)
    assert time[lost > 0].min() == pytest.approx(2.7, abs=0.06)  # 0.6 s after the last one came
    assert time[lost > 0].max() == pytest.approx(4.1, abs=0.1)
    assert np.all(np.diff(variance[silent]) > 0.0)
    assert variance[silent][-1] > 20.0 * variance[silent][0]
    assert nees[silent].max() < 16.27  # as far off as the covariance says, chi^2 of 3 at 99.9 %
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.01, 0.01, 0.03])


def test_lost_imu_is_said_and_the_camera_goes_on():
    fusion = Fusion()
    feed(fusion, [e for e in measurements(4.0) if e[1] == "camera" or e[2] < 2.0])
    estimate = fusion.estimate()
    assert estimate.imu_lost
    assert not estimate.camera_lost
    assert estimate.twist_covariance[2, 2] == LOST_VARIANCE
    assert np.hypot(*pose_error(estimate)[:2]) < 0.05


@pytest.mark.parametrize(
    ("silence", "camera_lost", "imu_lost"),
    [(0.02, False, False), (0.3, False, True), (0.8, True, True)],
)
def test_sensors_that_fall_silent_together_are_lost_after_their_times(
    silence, camera_lost, imu_lost
):
    fusion = Fusion()
    feed(fusion, measurements(3.0, latency=0.0))
    estimate = fusion.estimate(silence)
    assert (estimate.camera_lost, estimate.imu_lost) == (camera_lost, imu_lost)


@pytest.mark.parametrize("begun", [True, False])
def test_a_pose_from_the_future_is_refused_and_holds_nothing_up(begun):
    fusion, events = Fusion(), measurements(3.0)
    at = 2.0 if begun else 0.05
    feed(fusion, [e for e in events if e[0] < at])
    assert not fusion.add_pose(at + 5.0, truth(at)[0])
    for event in events:
        if event[0] >= at:
            feed(fusion, [event])
            if begun and event[1] == "imu":
                assert fusion.estimate().time == event[2]
                assert not fusion.estimate().imu_lost
    assert fusion.counts["pose_from_future"] == 1
    assert fusion.counts["pose_too_late"] == 0
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.01, 0.01, 0.03])


@pytest.mark.parametrize("jump", [5.0, -5.0, 1.0])
def test_a_camera_whose_clock_is_set_is_followed(jump):
    fusion, events = Fusion(), swum(6.0)
    feed(fusion, [(a, k, s + jump * (k == "camera" and s > 3.0), v) for a, k, s, v in events])
    assert fusion.camera_clock.jumps == 1
    assert fusion.applied_offset == pytest.approx(-jump, abs=0.02)
    assert not fusion.estimate().camera_lost


@pytest.mark.parametrize("latency", [0.1, 0.6, 1.0])
@pytest.mark.parametrize("late", [0.0, 0.05, 0.5, -1.0, 100.0])
def test_an_offset_that_nobody_told_is_found(latency, late):
    """late: how much later than the exposure the stamp is."""
    fusion, events = Fusion(), swum(8.0, latency)
    feed(fusion, [(a, k, s + late * (k == "camera"), v) for a, k, s, v in events])
    clock = fusion.camera_clock
    assert clock.current.sure
    assert abs(clock.current.offset + late) < max(0.005, 4.0 * clock.current.std)
    assert clock.age == pytest.approx(latency, abs=0.015)
    error = fusion.estimate().pose - true_pose(fusion.estimate().time)
    assert np.hypot(*error[:2]) < 0.02
    assert abs(error[2]) < 0.02


def errors_of_swum(fusion, events, clock_set=0.0, since=6.0):
    """Distances (N,) [m] and NEES (N,) of the estimates at the IMU's samples; clock_set: of the IMU at `since` [s]."""
    rows = []
    for arrival, kind, stamp, values in events:
        feed(fusion, [(arrival, kind, stamp, values)])
        estimate = fusion.estimate()
        if kind != "imu" or estimate is None or arrival < 2.0:
            continue
        error = estimate.pose - true_pose(estimate.time - clock_set * (arrival > since))
        error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi
        nees = error @ np.linalg.solve(estimate.pose_covariance, error)
        rows.append((np.hypot(*error[:2]), nees))
    return np.transpose(rows)


@pytest.mark.parametrize("jump", [-1.0037, -0.3, -0.2237, 0.15, 0.22])
def test_a_camera_s_clock_that_is_set_a_little_is_followed(jump):
    """The images seem to come later or earlier by as much, as they do where only their transport takes longer.

    Stamps that go back tell the two apart at once.
    """
    fusion, events = Fusion(), swum(10.0)
    moved = [(a, k, s + jump * (k == "camera" and a > 6.0), v) for a, k, s, v in events]
    distances, _ = errors_of_swum(fusion, moved)
    assert fusion.camera_clock.jumps == 1
    assert fusion.applied_offset == pytest.approx(-jump, abs=0.01)
    assert distances.max() < (0.02 if jump < 0.0 else 0.3)  # until it is noticed
    assert distances[-150:].max() < 0.02
    assert not fusion.estimate().camera_lost


def test_an_imu_s_clock_that_is_set_ahead_a_little_is_followed():
    fusion, events = Fusion(), swum(10.0)
    moved = [(a, k, s + 0.22 * (k == "imu" and a > 6.0), v) for a, k, s, v in events]
    distances, _ = errors_of_swum(fusion, moved, 0.22)
    assert fusion.camera_clock.jumps == 1
    assert fusion.applied_offset == pytest.approx(0.22, abs=0.01)
    assert distances[-100:].max() < 0.01


@pytest.mark.parametrize("begin", [0.0, 6.0])
@pytest.mark.parametrize("late", [0.16, 0.35])
def test_an_imu_that_comes_later_than_the_camera_is_fused_at_the_right_time(begin, late):
    fusion, events = Fusion(), swum(12.0, latency=0.05)
    moved = [(a + late * (k == "imu" and a > begin), k, s, v) for a, k, s, v in events]
    distances, nees = errors_of_swum(fusion, sorted(moved, key=lambda e: e[0]))
    assert fusion.camera_clock.current.sure
    assert fusion.camera_clock.jumps == 0
    assert fusion.applied_offset == pytest.approx(0.0, abs=0.005)
    assert distances[-400:].max() < 0.01
    assert np.mean(nees < 16.27) > 0.95


@pytest.mark.parametrize("later", [0.15, 0.6])
def test_images_that_come_later_with_right_stamps_are_no_set_clock(later):
    fusion, events = Fusion(), swum(10.0)
    late = [(a + later * (k == "camera" and a > 6.0), k, s, v) for a, k, s, v in events]
    distances, nees = errors_of_swum(fusion, sorted(late, key=lambda e: e[0]))
    assert fusion.camera_clock.jumps == 0
    assert fusion.applied_offset == pytest.approx(0.0, abs=0.005)
    assert fusion.camera_clock.age == pytest.approx(0.08 + later, abs=0.02)
    assert distances.max() < 0.04
    assert np.mean(nees < 16.27) > 0.95


def test_a_network_that_mixes_up_images_for_long_does_not_hold_all_of_them_back():
    """Every image comes late, each by another time and many out of order: no clock was set."""
    fusion, random = Fusion(), np.random.default_rng(0)
    late = [
        (a + random.uniform(0.15, 0.7) * (k == "camera" and a > 4.0), k, s, v)
        for a, k, s, v in swum(14.0)
    ]
    feed(fusion, sorted(late, key=lambda e: e[0]))
    assert fusion.camera_clock.jumps == 0
    assert fusion.counts["pose_clock_undecided"] < 110  # 3 s of them
    assert not fusion.estimate().camera_lost
    error = fusion.estimate().pose - true_pose(fusion.estimate().time)
    assert np.hypot(*error[:2]) < 0.05


@pytest.mark.parametrize("back", [0.05, 0.3, 1.0, 1.99])
def test_both_clocks_set_back_by_less_than_the_history_start_anew(back):
    fusion, events = Fusion(), swum(8.0)
    moved = [(a, k, s - back * (a > 6.0), v) for a, k, s, v in events]
    distances, _ = errors_of_swum(fusion, moved, -back)
    assert fusion.counts["restarted"] == 1
    assert fusion.counts["imu_out_of_order"] + fusion.counts["imu_duplicate"] <= 4
    assert distances[-100:].max() < 0.02
    assert fusion.applied_offset == pytest.approx(0.0, abs=0.005)


@pytest.mark.parametrize(
    ("latency", "late", "back", "first", "last"),
    [(0.75, 0.26, 0.058, 8.34, 8.68), (0.64, 0.43, 0.05, 8.9, 10.5), (0.53, 0.15, 0.3, 7.0, 7.5)],
)
def test_both_clocks_set_back_and_a_silent_imu_make_no_other_stroke_sure(
    latency, late, back, first, last
):
    fusion, rows = Fusion(), []
    for arrival, kind, stamp, values in gap(swum(14.0, latency), first, last):
        ahead = -back if stamp > 8.0 else 0.0
        feed(fusion, [(arrival, kind, stamp + ahead + late * (kind == "camera"), values)])
        estimate = fusion.estimate()
        if estimate is not None and arrival > 4.0 and estimate.time == stamp + ahead:
            error = np.hypot(*(estimate.pose - true_pose(stamp))[:2])
            std = np.sqrt(np.trace(estimate.pose_covariance[:2, :2]))
            rows.append((error, std, fusion.camera_clock.current.sure))
    error, std, sure = np.transpose(rows)
    assert np.all((error < 6.0 * std) | (error < 0.02))
    assert error[-100:].max() < 0.02
    assert sure[-1]


def test_a_few_imu_samples_out_of_order_set_no_clock_back():
    fusion = Fusion()
    for k, event in enumerate(measurements(3.0)):
        feed(fusion, [event])
        if k % 10 == 0 and event[1] == "imu" and event[2] > 0.2:
            feed(fusion, [("late", "imu", event[2] - d, event[3]) for d in (0.03, 0.02, 0.01)])
    assert fusion.counts["imu_out_of_order"] > 50
    assert fusion.counts["restarted"] == 0


def test_a_latency_that_changes_is_followed():
    events = swum(30.0)
    fusion = Fusion()
    feed(fusion, [(a, k, s + 0.08 * (k == "camera" and s > 10.0), v) for a, k, s, v in events])
    assert fusion.applied_offset == pytest.approx(-0.08, abs=0.005)
    assert fusion.counts["reacquired"] == 0


def test_a_fish_at_rest_does_not_tell_the_offset():
    fusion = Fusion()
    feed(fusion, swum(12.0, rest=20.0))
    assert not fusion.camera_clock.current.sure
    assert fusion.applied_offset == 0.0


def test_poses_that_come_twice_are_counted_and_used_once():
    once, twice = Fusion(), Fusion()
    for event in measurements(3.0):
        feed(once, [event])
        feed(twice, [event, event])
    poses = sum(e[1] == "camera" for e in measurements(3.0))
    assert twice.counts["pose_duplicate"] == poses
    assert twice.counts["imu_duplicate"] == 300
    np.testing.assert_array_equal(once.estimate().pose, twice.estimate().pose)


def test_a_frozen_picture_with_new_stamps_is_noticed():
    fusion, frozen = Fusion(), None
    for arrival, kind, stamp, values in measurements(8.0):
        if kind == "camera" and stamp > 4.0:
            frozen = values if frozen is None else frozen
            values = frozen
        feed(fusion, [(arrival, kind, stamp, values)])
    estimate = fusion.estimate()
    assert fusion.counts["pose_repeated"] > 100
    assert fusion.counts["reacquired"] == 0
    assert estimate.camera_lost
    error = pose_error(estimate)
    assert error @ np.linalg.solve(estimate.pose_covariance, error) < 16.27


def test_a_fish_at_rest_may_be_seen_at_the_same_place_to_the_last_digit():
    fusion = Fusion()
    for k in range(300):
        fusion.add_imu(0.01 * k, 0.0, 0.0, 0.0)
        if k % 3 == 0:
            fusion.add_pose(0.01 * k, [0.3, 0.2, 1.0])
    assert fusion.counts["pose_repeated"] == 0
    assert not fusion.estimate().camera_lost


def test_a_gyro_that_is_not_measured_is_not_used():
    fusion, errors = Fusion(), []
    for k in range(1500):
        t = 0.01 * k
        psi = 0.8 * np.sin(0.9 * t)
        fusion.add_imu(t, None, None, None)
        if k % 3 == 0:
            fusion.add_pose(t, [0.3, 0.2, psi], np.diag([1e-5, 1e-5, 1e-4]))
        estimate = fusion.estimate()
        if estimate is not None:
            errors.append(estimate.pose[2] - psi)
            assert estimate.twist_covariance[2, 2] == LOST_VARIANCE
    assert np.std(errors) < 0.02


def test_an_orientation_stands_in_for_a_wrong_gyro():
    """Its zero is unknown; the gyro measures 30 % too little."""
    rng, errors = np.random.default_rng(3), {}
    for oriented in (False, True):
        fusion, rows = Fusion(), []
        for _, kind, stamp, values in swum(10.0, latency=0.5):
            if kind == "imu":
                yaw = true_pose(stamp)[2] + 2.0 + rng.normal(0.0, 0.003)
                fusion.add_imu(stamp, 0.7 * values[0], *values[1:], yaw if oriented else None)
                if fusion.estimate() is not None and stamp > 5.0:
                    rows.append(fusion.estimate().pose[2] - true_pose(stamp)[2])
            else:
                fusion.add_pose(stamp, values)
        errors[oriented] = np.sqrt(np.mean(np.square(rows)))
    assert errors[True] < 0.02
    assert errors[True] < 0.3 * errors[False]


def test_an_orientation_that_leads_its_gyro_is_named_and_the_camera_s_offset_said_to_the_gyro():
    rng, fusion, lead, late = np.random.default_rng(3), Fusion(), 0.015, 0.49
    for _, kind, stamp, values in swum(20.0, latency=0.5):
        if kind == "imu":
            yaw = true_pose(stamp + lead)[2] + 2.0 + rng.normal(0.0, 0.003)
            fusion.add_imu(stamp, 0.7 * values[0], *values[1:], yaw)
        else:
            fusion.add_pose(stamp + late, values)
    values = clock_values(fusion)
    assert float(values["imu_heading_lead_s"]) == pytest.approx(lead, abs=0.003)
    assert float(values["camera_offset_s"]) == pytest.approx(-late - lead, abs=0.003)
    assert float(values["camera_offset_to_gyro_s"]) == pytest.approx(-late, abs=0.004)
    assert 0.0 < float(values["camera_offset_to_gyro_std_s"]) < 0.004


def test_without_a_sure_offset_none_is_said_to_the_gyro():
    fusion = Fusion()
    feed(fusion, swum(4.0, rest=4.0))
    assert "camera_offset_to_gyro_s" not in clock_values(fusion)


@pytest.mark.parametrize("ahead", [0.02, 0.05])
def test_a_camera_a_little_ahead_of_the_imu_does_not_repeat_stamps(ahead):
    fusion, times = Fusion(), []
    for arrival, kind, stamp, values in measurements(4.0, latency=0.0):
        if kind == "camera":
            stamp, values = stamp + ahead, truth(stamp + ahead)[0]
        feed(fusion, [(arrival, kind, stamp, values)])
        if kind == "imu" and fusion.estimate() is not None:
            times.append((stamp, fusion.estimate().time))
    stamps, estimated = np.transpose(times)
    assert len(stamps) > 350
    assert fusion.counts["pose"] > 100
    np.testing.assert_array_equal(estimated, stamps)


def test_without_imu_the_camera_s_history_has_an_end():
    fusion = Fusion()
    feed(fusion, [e for e in measurements(6.0) if e[1] == "camera"])
    assert not fusion.add_pose(3.0, truth(3.0)[0])
    assert fusion.counts["pose_too_late"] == 1
    assert fusion.add_pose(5.5, truth(5.5)[0])


def test_a_clock_set_back_starts_anew():
    fusion = Fusion()
    feed(fusion, [(a + 100, k, s + 100, v) for a, k, s, v in measurements(2.0)])
    feed(fusion, measurements(2.0))
    assert fusion.counts["restarted"] == 1
    assert fusion.estimate().time < 3.0
    assert np.hypot(*pose_error(fusion.estimate())[:2]) < 0.02


def test_a_clock_set_back_starts_anew_without_an_imu_too():
    fusion, poses = Fusion(), [e for e in measurements(2.0) if e[1] == "camera"]
    feed(fusion, [(a + 100, k, s + 100, v) for a, k, s, v in poses])
    feed(fusion, poses)
    assert fusion.counts["restarted"] == 1
    assert fusion.counts["started"] == 2
    assert fusion.counts["pose_too_late"] == 2  # a straggler says nothing about the clock, three do
    assert fusion.estimate().time < 3.0
    assert np.hypot(*pose_error(fusion.estimate())[:2]) < 0.05


@pytest.mark.parametrize("imu", [True, False])
def test_single_poses_from_long_ago_do_not_set_the_clock_back(imu):
    """With an IMU that lives they may even come in a row: it would say so."""
    fusion = Fusion()
    for k, event in enumerate(e for e in measurements(6.0) if imu or e[1] == "camera"):
        feed(fusion, [event])
        old = event[0] > 3.0 and (k % 2 == 0 or (imu and event[1] == "camera"))
        assert not (old and fusion.add_pose(event[2] - 2.5, truth(event[2] - 2.5)[0]))
    assert fusion.counts["pose_too_late"] > 40
    assert fusion.counts["restarted"] == 0


def test_a_negative_silence_takes_back_no_loss():
    """The node's clock may be set back while the sensors' is not."""
    fusion = Fusion()
    feed(fusion, [e for e in measurements(4.0) if e[1] == "camera" or e[2] < 2.0])
    assert fusion.estimate().imu_lost
    assert fusion.estimate(-90.0).imu_lost


def test_nothing_is_estimated_before_poses_agree():
    fusion = Fusion()
    fusion.add_imu(0.0, 0.0, 0.0, 0.0)
    for k in range(20):  # jumps of a metre
        assert not fusion.add_pose(0.01 + k / 30.0, [float(k % 2), 0.0, 0.0])
    assert fusion.estimate() is None
    fusion.add_imu(0.7, 0.0, 0.0, 0.0)
    assert [fusion.add_pose(0.7 + k / 30.0, [0.0, 0.0, 0.0]) for k in range(3)] == [
        False,
        False,
        True,
    ]
    assert fusion.counts["started"] == 1


def test_camera_offset_moves_the_stamps():
    fusion = Fusion(FusionConfig(camera_offset=-0.05))
    feed(fusion, [(a, k, s + 0.05 * (k == "camera"), v) for a, k, s, v in measurements(5.0)])
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.008, 0.008, 0.03])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("gate", -1.0),
        ("gate", np.inf),
        ("camera_position_noise", 0.0),
        ("gyro_noise", 0.0),
        ("imu_timeout", np.nan),
        ("camera_offset_std", 0.0),
        ("largest_accel", 0.0),
        ("largest_yaw_rate", np.inf),
    ],
)
def test_config_names_field_and_value(field, value):
    with pytest.raises(ValueError, match=f"{field} is {value!r}, expected a finite number > "):
        FusionConfig(**{field: value})


def gap(events, first, last):
    """Events without the IMU's samples between two times [s]."""
    return [e for e in events if not (e[1] == "imu" and first < e[2] < last)]


@pytest.mark.parametrize("silence", [0.15, 0.3, 0.6])
def test_poses_that_come_while_the_imu_pauses_are_used(silence):
    fusion = Fusion()
    feed(fusion, gap(measurements(4.0, latency=0.0), 2.0, 2.0 + silence))
    assert fusion.counts["pose_from_future"] == 0
    assert fusion.counts["pose"] >= 115  # of 120, three of which start it
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.01, 0.01, 0.03])


@pytest.mark.parametrize("future", [1, 2])
def test_future_stamps_while_the_imu_pauses_hold_nothing_up(future):
    fusion, sent = Fusion(), 0
    for event in gap(measurements(6.0), 2.0, 2.6):
        feed(fusion, [event])
        if event[0] > 2.4 and sent < future:
            assert not fusion.add_pose(event[0] + 1e5 + sent, event[3])
            sent += event[1] == "camera"
    assert fusion.counts["pose_from_future"] >= future
    assert fusion.counts["pose_too_late"] == 0
    assert fusion.counts["restarted"] == 0
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.01, 0.01, 0.03])


@pytest.mark.parametrize("future", [5, 12])
def test_an_imu_that_speaks_again_ends_a_row_of_future_stamps(future):
    """Without an IMU so many of them are a clock that was set."""
    fusion, events = Fusion(), measurements(6.0)
    feed(fusion, [e for e in events if e[0] < 3.0])
    for k in range(future):
        fusion.add_pose(1e5 + k / 30.0, truth(3.0)[0])
    feed(fusion, [e for e in events if e[0] >= 3.0])
    assert fusion.counts["restarted"] == (future > 5)
    assert fusion.estimate().time == pytest.approx(5.99)
    assert np.all(np.abs(pose_error(fusion.estimate())) < [0.01, 0.01, 0.03])
    assert not fusion.estimate().camera_lost


def test_a_camera_s_clock_set_ahead_while_no_imu_lives_is_followed():
    fusion, poses = Fusion(), [e for e in measurements(4.0) if e[1] == "camera"]
    feed(fusion, [(a, k, s + 100.0 * (s > 2.0), v) for a, k, s, v in poses])
    assert fusion.counts["pose_from_future"] == 2
    assert fusion.counts["restarted"] == 0
    assert fusion.estimate().time > 103.9


@pytest.mark.parametrize("stamp", [0.0, 50.0, 2.0**31])
@pytest.mark.parametrize("count", [1, 3])
def test_single_stamps_of_the_imu_from_another_time_are_dropped(stamp, count):
    fusion, begin = Fusion(), 100.0
    for arrival, kind, time, values in measurements(6.0):
        feed(fusion, [(arrival, kind, time + begin, values)])
        if kind == "imu" and time == pytest.approx(3.0):
            before = fusion.estimate()
            assert not any(fusion.add_imu(stamp + 0.01 * k, *values) for k in range(count))
            np.testing.assert_array_equal(fusion.estimate().pose, before.pose)
    assert fusion.counts["imu_out_of_order" if stamp < begin else "imu_from_future"] == count
    assert fusion.counts["restarted"] == 0
    estimate = fusion.estimate()
    assert estimate.time == pytest.approx(begin + 5.99)
    assert np.hypot(*(estimate.pose - truth(estimate.time - begin)[0])[:2]) < 0.01


@pytest.mark.parametrize("ahead", [60.0, 3600.0])
def test_both_clocks_set_ahead_lose_three_samples_and_go_on(ahead):
    fusion, events = Fusion(), swum(10.0)
    moved = [(a, k, s + ahead * (a > 6.0), v) for a, k, s, v in events]
    distances, _ = errors_of_swum(fusion, moved, ahead)
    assert fusion.counts["imu_from_future"] == 3
    assert fusion.counts["restarted"] == 0
    assert distances[-100:].max() < 0.02


@pytest.mark.parametrize("far", [1.1e3, -1e13, 1e300])
@pytest.mark.parametrize("begun", [False, True])
def test_positions_that_no_fish_can_have_neither_start_nor_move_the_estimate(begun, far):
    fusion = Fusion()
    feed(fusion, measurements(2.0) if begun else [])
    for k in range(60):
        fusion.add_imu(3.0 + 0.03 * k, 0.0, 0.0, 0.0)
        assert not fusion.add_pose(3.0 + 0.03 * k, [far, 0.0, 0.0])
        assert not fusion.add_pose(3.01 + 0.03 * k, [0.0, far, 0.0])
    assert fusion.counts["pose_implausible"] == 120
    assert fusion.counts["reacquired"] == 0
    assert (fusion.estimate() is not None) == begun
    feed(fusion, [(a, k, s + 6.0, v) for a, k, s, v in measurements(3.0)])
    assert np.hypot(*(fusion.estimate().pose - truth(2.99)[0])[:2]) < 0.02


def test_poses_that_never_agree_are_not_kept():
    fusion, kept = Fusion(), 0
    for k in range(1000):
        fusion.add_imu(k / 30.0, 0.0, 0.0, 0.0)
        fusion.add_pose(k / 30.0, [float(k % 2), 0.0, 0.0])
        kept = max(kept, len(fusion._raw))
    assert kept <= 30 * (fusion.config.history + 0.2)


@pytest.mark.parametrize("imu", [True, False])
def test_a_future_stamp_at_first_does_not_keep_all_poses_after_it(imu):
    fusion = Fusion()
    fusion.add_pose(1e5, truth(0.0)[0])
    feed(fusion, [e for e in measurements(8.0) if imu or e[1] == "camera"])
    assert fusion.counts["started"] == 1
    assert len(fusion._raw) <= 30 * (fusion.config.history + 0.2)


@pytest.mark.parametrize("std", [4.0, 1e80, 1e155])
def test_an_orientation_that_says_nothing_is_left_out(std):
    plain, fusion = Fusion(), Fusion()
    for event in measurements(3.0):
        feed(plain, [event])
        if event[1] == "imu":
            fusion.add_imu(event[2], *event[3], 1.0, std)
        else:
            feed(fusion, [event])
    np.testing.assert_array_equal(fusion.estimate().pose, plain.estimate().pose)
