# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The constants of feed-forward, slip and water filter against the simulated fish, which knows nothing of them."""

import numpy as np
import pytest

from fish_control.control_law import (
    ActuatorState,
    ControlLimits,
    Setpoint,
    actuator_step,
    feedforward_throttle,
)
from fish_control.current_observer import WaterState
from fish_control.current_observer import swim as swim_in_water
from fish_control.line_of_sight import GuidanceConfig, slip_lever
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper

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


def test_the_water_filter_foretells_how_a_change_of_throttle_is_answered():
    throttle = np.full((2800, 2), [0.2, 0.4])
    throttle[2000:] = [0.4, 0.0]  # faster; and gliding
    surge = simulated(np.stack([np.zeros_like(throttle), throttle], axis=-1))[..., 0]
    mean = np.array([np.convolve(column, np.ones(STROKE) / STROKE, "same") for column in surge.T]).T
    at = 2000 + np.arange(0, 700, 100)
    for k, (before, after) in enumerate([(0.2, 0.4), (0.4, 0.0)]):
        water, foretold = WaterState(speed=mean[1950, k], throttle=before), []
        for period in range(2000, 2800):
            foretold += [water.speed] if period in at else []
            water = swim_in_water(water, Setpoint(0.0, after), DT, LIMITS)
        np.testing.assert_allclose(foretold, mean[at, k], atol=0.017)
