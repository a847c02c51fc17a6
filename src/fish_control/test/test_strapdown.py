"""The motion model against closed forms and numeric derivatives."""

import numpy as np
import pytest

from fish_control.imu_history import InertialSample
from fish_control.strapdown import SIZE, MotionNoise, StrapdownFilter, pose_residual


def started(x):
    filter = StrapdownFilter(MotionNoise())
    filter.set(np.asarray(x, dtype=float), np.eye(SIZE) * 1e-4)
    return filter


def test_circle_at_constant_speed():
    u, r, T = 0.2, 0.8, 2.0
    filter = started([0, 0, 0, u, 0, 0, 0, 0])
    sample = InertialSample(r, 0.0, u * r)  # centripetal
    for _ in range(200):
        filter.advance(T / 200, sample, sample)
    radius = u / r
    expected = [radius * np.sin(r * T), radius * (1 - np.cos(r * T)), r * T]
    np.testing.assert_allclose(filter.x[:3], expected, atol=2e-5)
    assert np.hypot(*filter.x[3:5]) == pytest.approx(u, rel=1e-4)


def test_biases_are_taken_off():
    filter = started([0, 0, 0.3, 0.1, 0.0, 0.02, 0.1, -0.2])
    sample = InertialSample(0.02, 0.1, -0.2)
    for _ in range(100):
        filter.advance(0.01, sample, sample)
    np.testing.assert_allclose(filter.x[:5], [0.1, 0.0, 0.3, 0.1, 0.0], atol=1e-12)


def test_covariance_moves_with_the_numeric_jacobian():
    x = np.array([0.1, -0.2, 0.7, 0.2, -0.1, 0.01, 0.05, -0.03])
    before, after = InertialSample(1.5, 0.4, -0.6), InertialSample(1.7, 0.3, -0.5)

    def moved(state):
        filter = started(state)
        filter.advance(0.01, before, after)
        return filter.x.copy()

    F = np.column_stack([(moved(x + d) - moved(x - d)) / 2e-6 for d in np.eye(SIZE) * 1e-6])
    filter = started(x)
    P = np.diag(np.arange(1.0, 9.0)) * 1e-2
    filter.set(x, P)
    filter.advance(0.01, before, after)
    grown = filter.P - F @ P @ F.T
    np.testing.assert_allclose(grown - np.diag(np.diag(grown)), 0.0, atol=5e-6)
    assert np.all(np.diag(grown) >= -5e-6)


def test_without_imu_the_motion_goes_on_and_trust_fades():
    filter = started([0, 0, 0.5, 0.2, 0.0, 0, 0, 0])
    for _ in range(50):
        filter.advance(0.01, None, None)
    np.testing.assert_allclose(filter.x[:3], [0.1, 0.0, 0.5], atol=1e-9)
    assert np.sqrt(filter.P[2, 2]) > 0.3
    assert np.sqrt(filter.P[0, 0]) > 0.02


def test_correction_turns_the_short_way():
    filter = started([0, 0, np.pi - 0.01, 0, 0, 0, 0, 0])
    filter.correct(np.array([0.0, 0.0, -np.pi + 0.01]), np.eye(3) * 1e-6)
    assert abs(filter.x[2]) == pytest.approx(np.pi - 0.01, abs=1e-3)
    assert filter.x[2] < 0.0


def test_residual_of_headings():
    np.testing.assert_allclose(
        pose_residual(np.array([1, 2, 3.0]), np.array([0, 0, -3.0])), [1, 2, 6 - 2 * np.pi]
    )
