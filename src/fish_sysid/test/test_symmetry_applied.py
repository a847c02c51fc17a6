# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What symmetry tests find goes into the robot and into fits."""

from dataclasses import replace

import numpy as np
import pytest
from kinematic_swims import World, kinematic_swims

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import with_current
from fish_sysid.diagnosis.change.change import Change
from fish_sysid.diagnosis.change.change_json import changed_robot
from fish_sysid.diagnosis.symmetry.applied import applicable, in_still_water, with_findings
from fish_sysid.diagnosis.symmetry.finding import Estimate, SymmetryFinding


def finding(name: str, status: str = "found", **values: float) -> SymmetryFinding:
    parameters = {key: Estimate(value, 1e-3, "") for key, value in values.items()}
    return SymmetryFinding(name, "physics", status, "", "", parameters=parameters)


FLOW = finding("current", x=0.03, y=-0.02)
GYRO = finding("gyro_scale", factor=1.05)


def test_findings_go_into_the_robot_and_what_it_has_stays() -> None:
    robot = with_findings(Robot(), [FLOW, GYRO])
    assert robot.effects["current"] == {"x": 0.03, "y": -0.02}
    assert robot.sensors["gyro_scale"] == {"factor": 1.05}
    has = Robot().with_effect("current", x=0.01, y=0.0)
    assert with_findings(has, [FLOW]).effects["current"] == {"x": 0.01, "y": 0.0}


@pytest.mark.parametrize(
    "one",
    [
        finding("current", "not found", x=0.03, y=-0.02),
        finding("wall_effect", slowdown=0.2),  # no parameter of the effect
        finding("slower or faster in a part of the pool", faster=0.2),
        replace(FLOW, stands_alone=False),
    ],
)
def test_what_is_no_certain_effect_stays_out(one: SymmetryFinding) -> None:
    assert applicable([one], Robot()) == []
    assert with_findings(Robot(), [one]) == Robot()


def test_recordings_in_a_flow_are_fitted_as_the_water_sees_them() -> None:
    still = kinematic_swims(World(), 4, 2)
    back = in_still_water(with_current(still, (0.03, -0.02)), [FLOW])
    for a, b in zip(back.frames, still.frames, strict=True):
        np.testing.assert_allclose(a.pose, b.pose, atol=1e-12)
    assert in_still_water(still, [GYRO]) is still


def test_the_model_of_a_comparison_has_what_old_shows() -> None:
    robot = changed_robot(Change("unchanged", robot=Robot(), symmetry=(FLOW, GYRO)))
    assert robot.effects["current"] == {"x": 0.03, "y": -0.02}
    assert robot.sensors["gyro_scale"] == {"factor": 1.05}
