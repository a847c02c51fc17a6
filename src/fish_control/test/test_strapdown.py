# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The motion model against closed forms and numeric derivatives."""

import numpy as np
import pytest

from fish_control.fusion_config import MotionNoise
from fish_control.imu_history import Step
from fish_control.strapdown import SIZE, START_STD, StrapdownFilter, pose_residual


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
