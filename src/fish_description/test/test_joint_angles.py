# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Joint angles: what is measured, commanded, or follows from the springs."""

from __future__ import annotations

import math

import pytest

from fish_description.joint_angles import JointAngles, JointAnglesConfig, tail_names


@pytest.fixture
def joints() -> JointAngles:
    return JointAngles(JointAnglesConfig())


def test_a_fish_of_which_nothing_is_known_is_straight(joints: JointAngles) -> None:
    names = ("rotor", "rudder", "tail_1", "tail_2", "tail_3")
    assert joints.angles(0.0) == dict.fromkeys(names, 0.0)


def test_the_tail_rests_against_the_rudder_where_no_camera_sees_it(joints: JointAngles) -> None:
    joints.command(["rotor", "rudder"], [1.5, 0.3])
    assert joints.angles(0.0) == {
        "rotor": 0.0,
        "rudder": 0.3,
        "tail_1": -0.3,
        "tail_2": 0.0,
        "tail_3": 0.0,
    }


def test_what_the_camera_sees_counts_until_it_is_old(joints: JointAngles) -> None:
    joints.command(["rudder"], [0.2])
    joints.camera(["tail_1", "tail_2"], [-0.5, 0.1], now=10.0)
    assert joints.angles(10.5)["tail_1"] == -0.5
    assert joints.angles(10.5)["tail_3"] == 0.0
    assert joints.angles(10.51)["tail_1"] == -0.2


def test_the_rotor_is_measured_and_stays_within_one_turn(joints: JointAngles) -> None:
    joints.command(["rotor"], [2.0])  # a phase of the stroke
    assert joints.angles(0.0)["rotor"] == 0.0
    joints.encoder(["rotor"], [0.5 + 6 * math.pi])
    assert joints.angles(0.0)["rotor"] == pytest.approx(0.5)


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_what_is_not_finite_is_left_out(joints: JointAngles, angle: float) -> None:
    joints.encoder(["rotor"], [1.0])
    joints.encoder(["rotor"], [angle])
    joints.command(["rotor", "rudder"], [0.0])  # a message without the rudder's position
    joints.command(["rudder"], [angle])
    joints.camera(["tail_1"], [angle], now=0.0)
    assert joints.angles(0.0)["rotor"] == 1.0
    assert joints.angles(0.0)["tail_1"] == 0.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("rate_hz", 0.0), ("rate_hz", math.nan), ("tail_links", 0), ("tail_timeout", -1.0)],
)
def test_a_parameter_out_of_range_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{name}: got .*; expected"):
        JointAnglesConfig(**{name: value})


def test_names_are_those_of_the_tracker() -> None:
    assert tail_names(2) == ("tail_1", "tail_2")
