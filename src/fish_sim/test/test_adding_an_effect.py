# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The example of docs/adding_an_effect.md, run as it is written."""

import re
from pathlib import Path

import pytest
import yaml

from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot
from fish_sim.robot_file import load_robot

PAGE = Path(__file__).parent.parent / "docs" / "adding_an_effect.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.DOTALL)


@pytest.fixture
def table():
    before = dict(EFFECTS)
    yield EFFECTS
    EFFECTS.clear()
    EFFECTS.update(before)


def test_the_example_works_and_says_what_it_does(table, capsys, tmp_path):
    effect_file, table_line, use = blocks("python")
    names = {"EFFECTS": table}
    exec(compile(effect_file, "drag_arm.py", "exec"), names)
    exec(table_line, names)
    exec(use, names)
    headings = re.findall(r"heading (-?[\d.]+) rad", capsys.readouterr().out)
    assert len(headings) == 2
    assert headings[0] != headings[1]
    robot = tmp_path / "robot.yaml"
    robot.write_text(yaml.safe_dump({"format": 1, **yaml.safe_load(blocks("yaml")[0])}))
    assert load_robot(robot) == Robot().with_effect("drag_arm", arm=0.02)
