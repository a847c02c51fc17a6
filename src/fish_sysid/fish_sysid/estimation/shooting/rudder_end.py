# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the rudder ends, when commands go beyond the range that the robot's file states.

The largest command of the training trials says nothing of an end: a range put there would stop the rudder in other trials,
where the real one went on. The rudder therefore has no end, unless trials left out are predicted better with one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.shooting.fold_steps import FOLDS
from fish_sysid.estimation.shooting.left_out import (
    Step,
    converged,
    judged,
    left_out_costs,
    step_text,
)
from fish_sysid.estimation.shooting.residuals import SENSORS
from fish_sysid.estimation.shooting.schedule import Found

RANGE = "rudder_range"
WIDEST = np.pi / 2  # rad, the largest range of a robot's file: no end
BELOW = (
    0.8,
    0.95,
)  # of the largest command: where an end that is tried starts, so that commands beyond it move it


def largest_command(experiment: Experiment) -> float:
    """The largest rudder command, to either side [rad]."""
    return float(np.abs(experiment.given_commands[:, 1]).max())


def without_false_end(robot: Robot, experiment: Experiment) -> Robot:
    """The robot, its rudder without an end where commands go beyond its range."""
    if largest_command(experiment) <= robot.parameters[RANGE]:
        return robot
    return robot.with_parameters(**{RANGE: WIDEST})


def with_end(hypothesis: Hypothesis, end: float) -> Hypothesis:
    """The hypothesis with a rudder that ends at `end` [rad], free."""
    robot = hypothesis.robot.with_parameters(**{RANGE: end})
    return replace(hypothesis, robot=robot, free=(*hypothesis.free, RANGE))


def judged_end(
    experiment: Experiment, found: Found, report: Callable[[str], None] = lambda _: None
) -> tuple[Found, tuple[Step, ...]]:
    """(the fit, its rudder with an end if trials left out ask for one, what was judged).

    Nothing is judged where the rudder's range is the one of the robot's file, or where there are too few trials.
    """
    if found.hypothesis.robot.parameters[RANGE] < WIDEST or len(experiment.names) < FOLDS:
        return found, ()
    report("does the rudder end below its commands?")
    found, control = left_out_costs(experiment, found)
    starts = ends(found, largest_command(experiment))
    ended, costs = converged(experiment, starts, found.cost)
    step = judged(RANGE, control, costs)
    step = replace(step, added=step.sure)
    report(f"{RANGE}: {step_text(step)}")
    return (ended if step.added else found), (step,)


def ends(found: Found, largest: float) -> Iterator[Found]:
    """The fit with an end of the rudder, ever nearer to the largest command [rad], or to WIDEST where commands go beyond."""
    z = np.insert(found.z, len(found.z) - len(SENSORS), 0.0)
    hypotheses = (with_end(found.hypothesis, below * min(largest, WIDEST)) for below in BELOW)
    return (replace(found, hypothesis=hypothesis, z=z) for hypothesis in hypotheses)
