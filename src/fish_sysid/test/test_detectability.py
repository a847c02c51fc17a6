# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Names that swims can tell apart, by sensitivities: what physics says of a straight and of a turning swim."""

import numpy as np
import pytest

from fish_control.excitation import Program, Row
from fish_sim.robot import Robot
from fish_sysid.design.candidate_swims import swims_of_program
from fish_sysid.design.detectability import detectability, vocabulary
from fish_sysid.design.sensitivity import (
    SensorSet,
    information,
    innovations,
    shown,
    signals_of_parameters,
)
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import nominal_hypothesis

ROBOT = Robot(links=1)
FREE = ("head_drag_surge", "head_drag_sway", "head_drag_yaw", "tail_stiffness")
STRAIGHT = Program((Row(0.0, 6.0, 2.0, 0.0),), (6.0,))
TURNS = Program((Row(0.0, 6.0, 2.0, 0.5), Row(6.0, 6.0, 2.0, -0.5)), (6.0, 12.0))


def found(program, names, **sensors):
    swims = swims_of_program(program, ROBOT)
    return detectability(ROBOT, swims, names, SensorSet(**sensors), free=FREE)


def test_signals_of_parameters_are_the_slopes_of_which_the_information_is_made():
    hypothesis, swims = nominal_hypothesis(ROBOT, FREE), swims_of_program(TURNS, ROBOT)
    base = innovations(hypothesis, shown(ROBOT, swims, SensorSet()), Noise())
    J = signals_of_parameters(hypothesis, swims, SensorSet(), Noise(), base)
    expected = information(hypothesis, swims, SensorSet(), Noise()).sum(axis=0)
    assert J.T @ J == pytest.approx(expected, rel=0.05, abs=0.02 * np.abs(expected).max())
    assert np.abs(base).max() < 0.1  # the model follows its own robot


def test_a_straight_swim_says_nothing_of_the_rudder_and_turns_do():
    straight, turns = (found(p, ["rudder_gain", "rudder_lag"]) for p in (STRAIGHT, TURNS))
    assert np.isinf(straight.strength).all()
    assert (turns.strength < 1.0).all()


def test_a_rudder_offset_looks_like_a_camera_at_an_angle_more_than_like_late_images():
    turns = found(TURNS, ["rudder_offset", "camera_heading_offset", "camera_latency"])
    assert turns.alike[0, 1] > 0.3
    assert turns.alike[0, 2] < 0.1
    assert turns.telling[0, 1] > turns.telling[0, 2]
    assert np.diag(turns.alike) == pytest.approx(1.0, abs=0.02)


def test_slip_and_wake_at_the_tip_are_not_told_apart_by_a_steady_stroke():
    twins = found(STRAIGHT, ["tip_slip", "wake_memory"])
    assert twins.alike[0, 1] > 0.95
    assert (np.array([twins.telling[0, 1], twins.telling[1, 0]]) > twins.strength).all()


def test_without_an_imu_its_errors_are_not_seen_and_others_later():
    names = ["gyro_scale", "imu_latency", "rudder_gain"]
    full, blind = found(TURNS, names), found(TURNS, names, imu=0.0)
    assert np.isinf(blind.strength[:2]).all()
    assert blind.gain[2] < full.gain[2]


def test_late_images_are_seen_at_a_tenth_of_their_typical_age():
    assert found(TURNS, ["camera_latency"]).strength[0] < 0.1


def test_the_vocabulary_is_all_that_the_robot_does_not_have():
    assert "tip_slip" not in vocabulary(Robot().with_effect("tip_slip", mobility=0.1))
    assert len(vocabulary(Robot())) >= 31
    with pytest.raises(ValueError, match="unknown name 'wings'"):
        vocabulary(Robot(), ["wings"])
