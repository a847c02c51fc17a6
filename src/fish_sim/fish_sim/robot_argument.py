# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The robot that a command is given as a file."""

from __future__ import annotations

from pathlib import Path

from fish_report.errors import user_errors
from fish_sim.robot import Robot
from fish_sim.robot_file import load_robot


def read_model(path: Path | None) -> Robot:
    """The robot of a robot.yaml or model.yaml; None: the nominal robot.

    Raises:
        UserError: the file is not there or is no robot.
    """
    with user_errors():
        return Robot() if path is None else load_robot(path)
