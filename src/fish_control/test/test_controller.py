# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The controller between odometry and commands."""

import numpy as np
import pytest

from fish_control.control_law import Gains
from fish_control.controller import Controller, Reference, continued
from fish_control.line_of_sight import GuidanceConfig, Motion, slip_lever
from fish_control.policy import Policy
from fish_control.policy_spec import PolicySpec
from fish_control.stroke_mean import TURN_LAG

GAINS = Gains(0.3, 0.4, 0.03, 0.6, 0.07, 0.0)
LISTENS = Policy.constant(GAINS)
POLICY = Policy.constant(GAINS, PolicySpec(layers=(), guidance=GuidanceConfig(listen_time=0.0)))
STRAIGHT = Reference(0.0, 0.2, 0.0, 0.0)


def controller(heading=0.0, surge=0.2, policy=POLICY):
    made = Controller(policy)
    for k in range(3):
        made.observe(0.01 * k, Motion(0.0, 0.0, heading, surge, 0.0, 0.0))
    return made


def test_it_steers_towards_the_wanted_course():
    for course in (0.3, -0.3):
        made = controller()
        made.decide(Reference(course, 0.2, 0.0, 0.0))
        assert np.sign(made.command(0.01).alpha) == np.sign(course)


def test_gains_stay_within_limits_that_are_set():
    made = controller()
    made.limit_gains([0.0, 0.0, 0.0, 0.7, 0.0, 0.01], [0.2, 9.0, 9.0, 9.0, 9.0, 9.0])
    assert made.decide(STRAIGHT) == pytest.approx((0.2, 0.4, 0.03, 0.7, 0.07, 0.01))


def test_gains_are_the_policys():
    assert controller().decide(STRAIGHT) == pytest.approx(GAINS)


def test_a_slow_fish_gets_more_throttle():
    def rotor(surge):
        made = controller(surge=surge)
        for _ in range(25):
            made.decide(STRAIGHT)
            speeds = [made.command(0.01).rotor_speed for _ in range(2)]
        return np.abs(speeds).max()

    assert rotor(0.1) > rotor(0.2) > rotor(0.3)


def test_a_fish_at_rest_listens_before_its_first_stroke_and_one_under_way_does_not():
    made, moved = controller(surge=0.0, policy=LISTENS), []
    for k in range(3, 500):
        made.observe(0.01 * k, Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        assert made.decide(STRAIGHT) == pytest.approx(GAINS)
        moved.append(made.command(0.01).rotor_speed != 0.0)
    listened = LISTENS.contract.guidance.listen_time
    assert 0.01 * moved.index(True) == pytest.approx(listened, abs=0.05)
    assert listened > 1.0
    made = controller(surge=0.2, policy=LISTENS)
    made.decide(STRAIGHT)
    assert made.command(0.01).rotor_speed != 0.0


def test_rest_stops_rotor_and_centres_rudder_within_half_a_second():
    made = controller()
    for _ in range(50):
        made.decide(Reference(1.0, 0.2, 0.0, 0.0))
        made.command(0.02)
    made.rest()
    for _ in range(60):
        command = made.command(0.01)
    assert command.rotor_speed == pytest.approx(0.0, abs=1e-9)
    assert command.alpha == 0.0


def test_a_fish_that_swims_does_not_stop_to_listen_again():
    made = controller(surge=0.2, policy=LISTENS)
    made.decide(STRAIGHT)
    for k in range(3, 20):  # something holds it
        made.observe(0.01 * k, Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        made.decide(STRAIGHT)
        command = made.command(0.01)
    assert abs(command.rotor_speed) > 10.0  # rad/s


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_gliding_holds_the_rudder_without_drive_until_the_fish_has_stopped(side):
    made = controller(surge=0.15)
    made.decide(STRAIGHT)
    for _ in range(60):
        made.glide(0.5 * side, 0.01)
        command = made.command(0.01)
    assert command.rotor_speed == pytest.approx(0.0, abs=1e-9)
    assert command.alpha == 0.8 * side
    angles = []
    for k in range(500):  # noise about standing still does not start it again
        made.observe(1.0 + 0.01 * k, Motion(0.0, 0.0, 0.0, 0.015 + 0.03 * (k % 2), 0.0, 0.0))
        made.glide(0.5 * side, 0.01)
        angles.append(made.command(0.01).alpha)
    np.testing.assert_allclose(np.diff(angles[:300]), -0.002 * side, atol=1e-9)
    assert angles[-1] == 0.0
    made.observe(7.0, Motion(0.0, 0.0, 0.0, 0.15, 0.0, 0.0))
    made.decide(STRAIGHT)
    for _ in range(60):  # after the next path it does the same
        made.glide(0.5 * side, 0.01)
        command = made.command(0.01)
    assert command.alpha == 0.8 * side


def test_gliding_straight_on_when_no_turn_is_wanted():
    made = controller(surge=0.15)
    made.glide(0.0, 0.01)
    assert made.command(0.01) == (pytest.approx(2 * np.pi * 0.02), 0.0, 0.0)


def test_curvature_is_fed_forward():
    lever = slip_lever(0.2, POLICY.contract.guidance) - TURN_LAG * 0.2
    made = controller(heading=lever * 2.0)
    for _ in range(100):
        made.decide(Reference(0.0, 0.2, 0.4, 0.0))
        command = made.command(0.02)
    # a speed that comes from nowhere is taken for a current of 4 mm/s, so that the water asks for a little more
    assert command.alpha == pytest.approx(POLICY.contract.limits.curvature_gain * 2.0, rel=0.08)


def test_decide_before_odometry_is_an_error_of_the_caller():
    with pytest.raises(ValueError, match="before any odometry"):
        Controller(POLICY).decide(STRAIGHT)


def test_phase_is_published_within_one_turn():
    made = controller()
    phases = [made.command(0.01).phase for _ in range(200)]
    t = 0.01 * np.arange(1, 201)
    np.testing.assert_allclose(np.exp(1j * np.array(phases)), np.exp(4j * np.pi * t), atol=1e-9)
    assert 0.0 <= min(phases)
    assert max(phases) < 2.0 * np.pi


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_fish_that_faces_backwards_keeps_turning_the_same_way(side):
    errors, e = [], 0.0
    for k in range(400):  # facing pi, swinging by 0.3 rad
        measured = side * (np.pi - 0.1 + 0.3 * np.sin(0.25 * k))
        e = continued(e, float(np.arctan2(np.sin(measured), np.cos(measured))))
        errors.append(e)
    assert np.all(side * np.array(errors) > 2.0)


def test_continued_error_comes_back_within_reach():
    assert continued(3.0, -2.0) == -2.0
    assert continued(-3.0, 2.0) == 2.0
    assert continued(3.0, -3.1) == pytest.approx(2 * np.pi - 3.1)
    assert continued(0.1, 0.2) == pytest.approx(0.2)
