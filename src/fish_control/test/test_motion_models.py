# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the fusion learns of its accelerometer from the poses of a late camera."""

import math

import numpy as np
import pytest

from fish_control.fusion import Fusion
from fish_control.motion_models import FilterBank

LATENCY, REST = 0.6, 1.0  # s
CAMERA = np.array([0.002, 0.002, 0.012])  # m, m, rad
BAND = (0.2158, 9.348)  # chi^2 of 3, two-sided 95 %
W = 4.0 * np.pi


def true_pose(t):
    """A fish that waits, then swims a slow wave; its head swings twice a second."""
    s = max(t - REST, 0.0)
    swing = 0.2 * np.sin(W * s)
    way = 0.2 * (s - 1.0 + np.exp(-s))
    return np.array([way, 0.1 * (1.0 - np.cos(0.5 * s)), swing + 0.3 * np.sin(0.8 * s)])


def swum(seconds, accel_noise=0.05, roll=0.0, seed=0):
    """(arrival, stamp, pose or None, sample or None); roll: m/s^2 of gravity that leaks into the IMU's left axis."""
    rng, h, events = np.random.default_rng(seed), 1e-4, []
    for t in np.arange(0.0, seconds, 0.01):
        before, now, after = (true_pose(t + d) for d in (-h, 0.0, h))
        a = (after[:2] - 2.0 * now[:2] + before[:2]) / h**2
        c, s = np.cos(now[2]), np.sin(now[2])
        force = np.array([[c, s], [-s, c]]) @ a + rng.normal(0.0, accel_noise, 2)
        force[1] += roll * np.sin(W * (t - REST) + 1.0) * (t > REST)
        rate = (after[2] - before[2]) / (2.0 * h) + rng.normal(0.0, 0.006)
        events.append((t, t, None, (rate, *force)))
    for t in np.arange(0.003, seconds - LATENCY, 1.0 / 30.0):
        events.append((t + LATENCY, t, true_pose(t) + rng.normal(0.0, CAMERA), None))
    return sorted(events, key=lambda event: event[0])


def run(events, settled):
    """Errors (N, 3) and NEES (N,) of the estimates after `settled` [s], and the fusion."""
    fusion, errors, nees = Fusion(), [], []
    for arrival, stamp, pose, sample in events:
        if sample is None:
            fusion.add_pose(stamp, pose, np.diag(CAMERA**2))
            continue
        fusion.add_imu(stamp, *sample)
        if arrival > settled:
            estimate = fusion.estimate()
            error = estimate.pose - true_pose(estimate.time)
            error[2] = math.remainder(error[2], 2.0 * math.pi)
            errors.append(error)
            nees.append(error @ np.linalg.solve(estimate.pose_covariance, error))
    return np.array(errors), np.array(nees), fusion


def distance(errors):
    return math.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=1)))


def test_a_good_accelerometer_is_known_to_be_good_after_five_seconds_of_swimming():
    """A filter that was told the noise errs by 4.0 mm."""
    squares, inside = [], []
    for seed in range(3):
        errors, nees, fusion = run(swum(12.0, seed=seed), 6.0)
        assert fusion.motion_model.accel_used
        assert fusion.motion_model.accel_noise < 1.6 * 0.05
        squares.append(distance(errors) ** 2)
        inside.append(np.mean((nees > BAND[0]) & (nees < BAND[1])))
    assert math.sqrt(np.mean(squares)) < 0.0043
    assert np.mean(inside) > 0.9


def test_an_accelerometer_with_ten_times_its_noise_is_not_used():
    """Its noise alone would displace the fish by 13 mm in the time that the camera is late."""
    errors, nees, fusion = run(swum(14.0, accel_noise=0.5), 8.0)
    assert not fusion.motion_model.accel_used
    assert distance(errors) < 0.012
    assert np.mean(nees < BAND[1]) > 0.9


def test_an_accelerometer_that_a_rolling_head_disturbs_is_not_used():
    """Gravity that leaks in is larger than the acceleration of the head itself, as on the published robot."""
    errors, nees, fusion = run(swum(14.0, roll=0.8), 8.0)
    assert not fusion.motion_model.accel_used
    assert distance(errors) < 0.012
    assert np.mean(nees < BAND[1]) > 0.9


def test_what_is_not_known_yet_is_taken_for_bad():
    model = Fusion().motion_model
    assert model.accel_used
    assert model.accel_noise > 10.0 * 0.05


@pytest.mark.parametrize("true", [0.1, 1.0])
def test_the_bank_finds_the_noise_that_was_simulated(true):
    """A random walk seen through noise; three candidates, of which one is right."""
    rng, candidates = np.random.default_rng(2), np.array([0.01, 0.1, 1.0])
    bank, x = FilterBank(np.zeros(3)), 0.0
    bank.start(np.zeros(1), np.eye(1))
    F, u = np.ones((3, 1, 1)), np.zeros((3, 1))
    for _ in range(300):
        x += rng.normal(0.0, true)
        bank.predict(F, u, candidates[:, None, None] ** 2)
        bank.correct(np.array([x + rng.normal(0.0, 0.3)]), np.eye(1) * 0.09, 0.1, scored=True)
    assert candidates[bank.shares.argmax()] == true
    assert bank.shares.max() > 0.95
    assert bank.shares.sum() == pytest.approx(1.0)


def test_what_is_not_scored_changes_no_share():
    bank = FilterBank(np.log([0.25, 0.75]))
    bank.start(np.zeros(2), np.eye(2))
    bank.predict(np.tile(np.eye(2), (2, 1, 1)), np.zeros((2, 2)), np.zeros((2, 2, 2)))
    bank.correct(np.array([5.0]), np.eye(1), 1.0, scored=False)
    np.testing.assert_allclose(bank.shares, [0.25, 0.75])
    np.testing.assert_allclose(bank.x[:, 0], 2.5)  # but the filters follow
