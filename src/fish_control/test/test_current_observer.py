# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The filter of current and thrust: against the textbook's matrices, and what it learns in made-up waters."""

import numpy as np
import pytest

from fish_control import current_observer
from fish_control.control_law import ControlLimits, Setpoint, feedforward_throttle
from fish_control.current_observer import SIZE, WaterState, bounded, see_across, see_ahead, swim

LIMITS, DT = ControlLimits(), 0.01


def matrices(state):
    """Estimate (4,) and covariance (4, 4)."""
    P = np.zeros((SIZE, SIZE))
    P[np.triu_indices(SIZE)] = state[SIZE + current_observer.LAGGED :]
    return np.array(state[:SIZE]), P + P.T - np.diag(np.diag(P))


def some_state(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(SIZE, SIZE)) * [0.05, 0.02, 0.02, 0.1]
    x = [0.15, *rng.normal(0.0, 0.02, 2), 0.1]
    return WaterState(*x, 0.1, 0.25, 0.0, *(root.T @ root)[np.triu_indices(SIZE)])


@pytest.mark.parametrize("seed", range(3))
def test_prediction_is_that_of_an_extended_kalman_filter(seed):
    """F by finite differences; at a small step implicit and explicit drag agree."""
    state, setpoint, dt = some_state(seed), Setpoint(0.2, 0.3), 1e-5
    (x, P), eps = matrices(state), 1e-6

    def moved(values):
        return np.array(
            swim(state._replace(speed=values[0], thrust=values[3]), setpoint, dt, LIMITS)[:SIZE]
        )

    F = np.eye(SIZE)
    for k in (0, 3):
        step = eps * np.eye(SIZE)[k]
        F[:, k] = (moved(x + step) - moved(x - step)) / (2 * eps)
    F[1:3] = np.eye(SIZE)[1:3]  # the current was not handed over
    after = swim(state, setpoint, dt, LIMITS)
    turn = (current_observer.TURN_DRIFT * 0.2) ** 2 + (
        current_observer.MOVE_DRIFT * (0.2 - 0.1)
    ) ** 2
    drift = (current_observer.SPEED_DRIFT * after.throttle) ** 2 + turn
    Q = np.diag(
        [
            drift,
            current_observer.CURRENT_DRIFT**2,
            current_observer.CURRENT_DRIFT**2,
            current_observer.THRUST_DRIFT**2,
        ]
    )
    np.testing.assert_allclose(matrices(after)[1], F @ P @ F.T + dt * Q, atol=1e-11)
    rate = 1.1 * after.throttle - feedforward_throttle(0.15, 0.2, LIMITS)
    assert after.speed == pytest.approx(0.15 + dt * rate / current_observer.LAG, abs=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_correction_is_that_of_a_kalman_filter(seed):
    state, psi = some_state(seed), 0.7
    cos, sin = np.cos(psi), np.sin(psi)
    sway_variance = (current_observer.SWAY_NOISE**2 + (current_observer.MOVE_NOISE * 0.2) ** 2) / DT
    for after, h, measured, variance in (
        (
            see_ahead(state, 0.2, cos, sin, DT),
            [1.0, cos, sin, 0.0],
            0.2,
            current_observer.SURGE_NOISE**2 / DT,
        ),
        (see_across(state, 0.03, 0.3, cos, sin, DT), [0.0, -sin, cos, 0.0], 0.03, sway_variance),
    ):
        (x, P), h = matrices(state), np.array(h)
        K = P @ h / (h @ P @ h + variance)
        found, covariance = matrices(after)
        np.testing.assert_allclose(found, x + K * (measured - h @ x), rtol=1e-10)
        np.testing.assert_allclose(covariance, (np.eye(SIZE) - np.outer(K, h)) @ P, atol=1e-12)


def swum(current, headings, strength=1.0, seconds=6.0, u=0.15):
    """Memory after steady swimming on some headings with a robot `strength` times as strong as the nominal one."""
    state, throttle = WaterState(), feedforward_throttle(u, 0.0, LIMITS) / strength
    for psi in headings:
        cos, sin = np.cos(psi), np.sin(psi)
        ahead, left = u + cos * current[0] + sin * current[1], cos * current[1] - sin * current[0]
        for _ in range(round(seconds / DT)):
            state = see_ahead(swim(state, Setpoint(0.0, throttle), DT, LIMITS), ahead, cos, sin, DT)
            state = bounded(see_across(state, left, 0.0, cos, sin, DT), 0.1, np)
    return state


def test_a_current_ahead_of_a_fish_that_has_not_listened_is_shared_with_its_thrust_until_it_turns():
    state = swum([0.03, 0.0], [0.0], u=0.1)
    assert 0.0 < state.current_x < 0.031
    assert state.thrust > 0.0
    assert state.current_y == pytest.approx(0.0, abs=1e-6)


def test_a_strong_robot_is_told_from_a_current_by_turning():
    """Even in the same water: what is wrong after one heading is right after three."""
    for current in ([0.0, 0.0], [0.02, -0.02]):
        state = swum(current, [0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi], strength=1.15)
        assert (state.current_x, state.current_y) == pytest.approx(current, abs=5e-3)
        assert state.thrust == pytest.approx(0.15, abs=0.05)
        assert state.speed == pytest.approx(0.15, abs=5e-3)


def test_what_a_flick_of_the_rudder_does_is_not_taken_for_a_current():
    before = state = swum([0.0, 0.0], [0.0])
    throttle = feedforward_throttle(0.15, 0.0, LIMITS)
    for alpha, sway in ((0.4, 0.08), (-0.2, -0.04)):
        for _ in range(20):
            state = see_ahead(swim(state, Setpoint(alpha, throttle), DT, LIMITS), 0.2, 1.0, 0.0, DT)
            state = see_across(state, sway, alpha, 1.0, 0.0, DT)
    moved = state.current_x - before.current_x, state.current_y - before.current_y
    assert np.hypot(*moved) < 0.008


def test_a_fish_that_already_swims_is_not_taken_for_a_current():
    throttle, state = feedforward_throttle(0.2, 0.0, LIMITS), WaterState()
    for _ in range(300):
        state = see_ahead(swim(state, Setpoint(0.0, throttle), DT, LIMITS), 0.2, 1.0, 0.0, DT)
    assert state.speed == pytest.approx(
        0.2, abs=0.025
    )  # not 0.2 m/s of current; what is left goes in the first turn
    assert state.current_x == pytest.approx(0.0, abs=0.025)


def test_the_estimate_stays_within_its_limits():
    state = bounded(WaterState(0.1, 0.5, -0.5, 2.0), 0.1, np)
    assert (state.current_x, state.current_y, state.thrust) == (
        0.1,
        -0.1,
        current_observer.THRUST_LIMIT,
    )
