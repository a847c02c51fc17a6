# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The closed loop on the simulated fish, and the measures of its swimming."""

import casadi
import numpy as np
import pytest
from closed_loop import swim

from fish_control.control_law import (
    ActuatorState,
    ControlLimits,
    Setpoint,
    actuator_step,
    feedforward_throttle,
)
from fish_control.current_observer import WaterState
from fish_control.current_observer import swim as swim_in_water
from fish_control.hand_tuned import hand_tuned_policy
from fish_control.line_of_sight import GuidanceConfig, slip_lever
from fish_control.paths import make_path
from fish_control.stroke_mean import DAMPING, STROKE_FREQUENCY, StrokeState, stroke_step
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper

POLICY = hand_tuned_policy()


def test_the_letter_r_from_rest():
    score = swim(make_path("R"), 0.2, POLICY)
    assert score.finished
    assert score.cross_track_rmse < 0.015  # m; 0.009 when this was written, 0.03 asked for
    assert (
        score.speed_rmse < 0.022
    )  # m/s; 0.017, of which 0.016 is the stroke's own swing in the bends
    assert score.estimate_rmse < 0.004  # m; one camera frame is off by 0.0028


def test_a_slow_camera_costs_little():
    score = swim(make_path("S"), 0.2, POLICY, camera_latency=0.3)
    assert score.finished
    assert score.cross_track_rmse < 0.018
    assert score.speed_rmse < 0.022


def test_compensated_line_of_sight_beats_the_papers():
    path = make_path("S")
    paper = swim(path, 0.25, POLICY, guidance=GuidanceConfig(compensate_curvature=False))
    ours = swim(path, 0.25, POLICY)
    assert ours.cross_track_rmse < 0.5 * paper.cross_track_rmse


@pytest.mark.parametrize("start", [(-1.2, 0.5, 2.6), (-1.9, 0.6, -1.57)])
def test_from_a_pose_beside_the_path_that_faces_away(start):
    record = []
    score = swim(make_path("straight", length=3.4), 0.2, POLICY, start=start, record=record)
    rows = np.array(record)
    settled = rows[rows[:, 0] > 1.5]
    assert score.finished
    assert len(rows) < 3000
    assert np.abs(settled[:, 1]).max() < 0.05


@pytest.mark.parametrize("seed", [2])
def test_water_that_pushes(seed):
    score = swim(make_path("I"), 0.15, POLICY, seed=seed, disturbance=0.01)
    assert score.finished
    assert score.cross_track_rmse < 0.02


LIMITS = ControlLimits()
STROKE = 50  # periods of 10 ms
THROTTLES, RUDDERS = (0.1, 0.2, 0.4, 0.6), (0.0, 0.2, 0.4, -0.4)
CASES = [(throttle, rudder) for throttle in THROTTLES for rudder in RUDDERS]


def simulated(setpoints):
    """Motion (T, B, 3) of B fish from rest: surge [m/s], sway [m/s], heading [rad]; set-points (T, B, 2) of rudder, throttle."""
    stepper, state, commands = Stepper.of(Robot()), ActuatorState(0.0, 0.0, 0.0), []
    for alpha, throttle in np.moveaxis(setpoints, -1, 1):
        state, rotor_speed = actuator_step(state, Setpoint(alpha, throttle), DT, LIMITS, np)
        commands.append(np.column_stack([rotor_speed, state.alpha]))
    parameters, size = stepper.parameters(Robot()), stepper.layout.links + 3
    start = np.tile(stepper.rest(parameters=parameters), (setpoints.shape[1], 1))
    states = stepper.rollout(start, np.array(commands), parameters)[1:]
    heading, vx, vy = states[..., 2], states[..., size], states[..., size + 1]
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([cos * vx + sin * vy, cos * vy - sin * vx, heading], axis=-1)


@pytest.fixture(scope="module")
def steady():
    """By throttle and rudder: surge, sway [m/s] and curvature [1/m], means over ten strokes after 25 s."""
    setpoints = np.tile([(rudder, throttle) for throttle, rudder in CASES], (3000, 1, 1))
    motion = simulated(setpoints)[-10 * STROKE - 1 :]
    surge, sway, _ = motion.mean(axis=0).T
    turned = (motion[-1, :, 2] - motion[0, :, 2]) / (10 * STROKE * DT)
    return dict(zip(CASES, zip(surge, sway, turned / surge, strict=True), strict=True))


@pytest.mark.parametrize(("throttle", "rudder"), CASES)
def test_feedforward_is_the_throttle_that_holds_the_speed(throttle, rudder, steady):
    surge, *_ = steady[throttle, rudder]
    assert feedforward_throttle(surge, rudder, LIMITS) == pytest.approx(throttle, abs=0.02)


@pytest.mark.parametrize(("throttle", "rudder"), [case for case in CASES if case[1]])
def test_rudder_and_slip_of_a_curve_are_those_of_the_fish(throttle, rudder, steady):
    surge, sway, curvature = steady[throttle, rudder]
    assert LIMITS.curvature_gain * curvature == pytest.approx(rudder, rel=0.1)
    assert slip_lever(surge, GuidanceConfig()) * curvature == pytest.approx(
        -sway / surge, abs=0.012
    )


def test_the_water_filter_predicts_how_a_change_of_throttle_is_answered():
    throttle = np.full((2800, 2), [0.2, 0.4])
    throttle[2000:] = [0.4, 0.0]  # faster; and gliding
    surge = simulated(np.stack([np.zeros_like(throttle), throttle], axis=-1))[..., 0]
    mean = np.array([np.convolve(column, np.ones(STROKE) / STROKE, "same") for column in surge.T]).T
    at = 2000 + np.arange(0, 700, 100)
    for k, (before, after) in enumerate([(0.2, 0.4), (0.4, 0.0)]):
        water, predicted = WaterState(speed=mean[1950, k], throttle=before), []
        for period in range(2000, 2800):
            predicted += [water.speed] if period in at else []
            water = swim_in_water(water, Setpoint(0.0, after), DT, LIMITS)
        np.testing.assert_allclose(predicted, mean[at, k], atol=0.017)


W = 2.0 * np.pi * STROKE_FREQUENCY


def settle(rate, seconds=6.0, dt=0.01):
    """State and time after feeding a yaw rate and a sway r(t) of the same shape."""
    state = StrokeState()
    for t in np.arange(0.0, seconds, dt):
        state = stroke_step(state, rate(t), 0.1 * rate(t), dt)
    return state, t


@pytest.mark.parametrize("dt", [0.01, 0.02])
def test_swing_at_the_stroke_is_taken_off_whole(dt):
    amplitude = 0.2  # rad
    worst = 0.0
    state = StrokeState()
    for k, t in enumerate(np.arange(0.0, 8.0, dt)):
        middle = t + 0.5 * dt  # the rate is held over the step
        state = stroke_step(state, amplitude * W * np.cos(W * middle), 0.0, dt)
        if k * dt > 4.0:
            worst = max(worst, abs(state.heading - amplitude * np.sin(W * (t + dt))))
    assert worst < 0.1 * amplitude


def test_steady_turn_is_delayed_by_the_stated_time():
    state, _ = settle(lambda t: 0.5)
    assert state.heading == pytest.approx(0.5 * 2.0 * DAMPING / W, rel=1e-3)
    assert state.heading_rate == pytest.approx(0.0, abs=1e-6)
    assert state.sway == pytest.approx(0.0, abs=1e-6)


def test_mean_of_sway_is_kept_and_its_swing_removed():
    state, t = settle(lambda t: 1.0 + 3.0 * np.cos(W * t))
    mean = 0.1 * (1.0 + 3.0 * np.cos(W * t)) - state.sway
    assert mean == pytest.approx(0.1, abs=0.03)


def test_casadi_and_numpy_give_the_same():
    symbols = casadi.SX.sym("z", 7)
    out = stroke_step(
        StrokeState(*(symbols[i] for i in range(4))), symbols[4], symbols[5], symbols[6]
    )
    function = casadi.Function("stroke", [symbols], list(out))
    values = np.random.default_rng(0).normal(size=7) * 0.1 + [0, 0, 0, 0, 0, 0, 0.3]
    here = stroke_step(StrokeState(*values[:4]), values[4], values[5], values[6])
    np.testing.assert_allclose([float(v) for v in function(values)], here, rtol=1e-12)
