# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The noise that an identification found goes through robot.yaml to predictions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fish_report.errors import UserError
from fish_sim.robot import Robot, RobotError
from fish_sim.robot_file import load_robot, save_robot
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.prediction.kept_noise import kept_noise, uses_shooting, with_noise

NOISE = Noise(wrench=(0.1, 0.2, 0.003), gyro=0.2, camera_position=0.004)


def test_noise_and_states_come_back_from_the_file(tmp_path: Path) -> None:
    save_robot(with_noise(Robot(links=1), NOISE, "shooting"), tmp_path / "robot.yaml")
    robot = load_robot(tmp_path / "robot.yaml")
    assert kept_noise(robot) == NOISE
    assert uses_shooting(robot)
    assert robot.digest() == Robot(links=1).digest()


def test_a_robot_without_noise_keeps_none() -> None:
    assert kept_noise(Robot()) is None
    assert not uses_shooting(Robot())


@pytest.mark.parametrize(
    "bad", [{"gyro": -1.0}, {"wrench": [0.1]}, {"nonsense": 1.0}, {"gyro": "0.1"}]
)
def test_noise_that_cannot_be_used_is_refused(bad: dict[str, object]) -> None:
    with pytest.raises(UserError, match=r"prediction\.noise"):
        kept_noise(replace(Robot(), prediction={"noise": bad}))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("prediction: {states: guess}", "filter, shooting"),
        ("prediction: {other: 1}", "known: states, noise, trust"),
        (
            "parameters: {head_mass: {value: 0.465, knowledge: sure}}",
            "measured, estimated, unknown",
        ),
    ],
)
def test_a_file_with_an_unknown_word_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("format: 1\n" + text + "\n")
    with pytest.raises(RobotError, match=said):
        load_robot(path)


def test_what_is_known_of_a_parameter_comes_back(tmp_path: Path) -> None:
    robot = replace(Robot(), knowledge={"head_mass": "measured"})
    save_robot(robot, tmp_path / "robot.yaml")
    assert load_robot(tmp_path / "robot.yaml").knowledge == {"head_mass": "measured"}
