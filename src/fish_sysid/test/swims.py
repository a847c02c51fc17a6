# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small data sets with known answers: a fish of one link in short swims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise

GIVEN = Robot(links=1)


def fish(links: int = 1, **effects: Mapping[str, float]) -> Robot:
    """A fish whose drags and tail differ from the nominal ones by up to a third, with these effects."""
    robot = Robot(links=links)
    stiffness = 1.1 * robot.parameters["tail_stiffness"]
    robot = robot.with_parameters(
        head_drag_surge=0.26, head_drag_sway=1.2, tail_stiffness=stiffness
    )
    for name, values in effects.items():
        robot = robot.with_effect(name, **values)
    return robot


def swim(
    robot: Robot,
    kinds: Sequence[str] = ("sines", "steps", "random"),
    duration: float = 5.0,
    seed: int = 0,
    noise: Noise | None = None,
) -> Experiment:
    """Its recordings, a trial for each kind of manoeuvre."""
    random = np.random.default_rng(seed)
    commands = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
    return record(robot, commands, noise or Noise(), random)[0]
