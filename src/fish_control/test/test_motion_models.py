# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Models of how the head moves, and the observer of the water."""

import math

import numpy as np
import pytest

from fish_control import current_observer
from fish_control.control_law import ControlLimits, Setpoint, feedforward_throttle
from fish_control.current_observer import SIZE, WaterState, bounded, see_across, see_ahead, swim
from fish_control.fusion import Fusion
from fish_control.line_of_sight import Motion, MotionObserver
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


STILL = Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def observer():
    """Remembers the time it was fed, from stamp 10.0 to 10.5 s."""
    made = MotionObserver(0.0, lambda seconds, _, dt: seconds + dt)
    for k in range(51):
        made.add(10.0 + 0.01 * k, STILL)
    return made


def test_it_adds_up_the_time_between_stamps():
    assert observer().state == pytest.approx(0.5)


@pytest.mark.parametrize("stamp", [10.5, 10.49, 10.45])
def test_a_repeated_stamp_and_one_a_little_out_of_order_are_ignored(stamp):
    made = observer()
    made.add(stamp, STILL)
    assert made.state == pytest.approx(0.5)
    made.add(10.51, STILL)
    assert made.state == pytest.approx(0.51)  # nothing counts twice


@pytest.mark.parametrize("stamp", [10.7, 9.0])
def test_a_gap_and_a_clock_set_back_start_anew(stamp):
    made = observer()
    made.add(stamp, STILL)
    assert made.state == 0.0
    made.add(stamp + 0.01, STILL)
    assert made.state == pytest.approx(0.01)


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


def swum_in_water(current, headings, strength=1.0, seconds=6.0, u=0.15):
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
    state = swum_in_water([0.03, 0.0], [0.0], u=0.1)
    assert 0.0 < state.current_x < 0.031
    assert state.thrust > 0.0
    assert state.current_y == pytest.approx(0.0, abs=1e-6)


def test_a_strong_robot_is_told_from_a_current_by_turning():
    """Even in the same water: what is wrong after one heading is right after three."""
    for current in ([0.0, 0.0], [0.02, -0.02]):
        state = swum_in_water(current, [0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi], strength=1.15)
        assert (state.current_x, state.current_y) == pytest.approx(current, abs=5e-3)
        assert state.thrust == pytest.approx(0.15, abs=0.05)
        assert state.speed == pytest.approx(0.15, abs=5e-3)


def test_what_a_flick_of_the_rudder_does_is_not_taken_for_a_current():
    before = state = swum_in_water([0.0, 0.0], [0.0])
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
