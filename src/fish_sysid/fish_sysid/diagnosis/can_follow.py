# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether the likelihood can be asked for names: not where the model cannot follow the fish whatever effects it has.

The likelihood of the next 50 ms then prefers whatever helps over 50 ms, and a search of many minutes ends in names that are
none. Symmetry tests need no model, and predictions of trials left out judge a wrong model by what it is used for.
"""

from __future__ import annotations

from collections.abc import Iterable

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import align, moved_back
from fish_sysid.diagnosis.task import Task
from fish_sysid.diagnosis.vocabulary import known_effects
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE
from fish_sysid.estimation.shooting.schedule import TOO_FAR, misfit
from fish_sysid.estimation.shooting.selection import INTRINSIC

# effects of the pool that displace a fish by more than the camera's noise in two seconds, tried in turn
OF_POOL = (("current",), ("current", "tether"), ("nonuniform_current",))


def missed_by(task: Task) -> float | None:
    """By how many times the camera's noise the model misses two seconds of swimming; None where it can follow the fish.

    Start states, clocks, parameters and the effects of body, actuators and water are free, all at once; where a uniform flow is
    not enough, a line that pulls, and then a flow that varies over the pool. Images are first moved back by the age that camera
    and gyro show.
    """
    if not task.runs("can the model follow"):
        return None
    table, own, left = task.robot.table, known_effects(task.robot), 0.0
    for pool in OF_POOL:
        effects = [name for name in (*INTRINSIC, *pool) if name in table and name not in own]
        left = missed_with(effects, task.robot, task)
        if left <= TOO_FAR:
            return None
    return task.kept("can the model follow", None, left)


def missed_with(effects: Iterable[str], robot: Robot, task: Task) -> float:
    """The same of a robot that has these effects free, and no other but its own."""
    training = task.trials.training
    if "camera_latency" not in robot.sensors:
        training = moved_back(training, align(training).delay)
    return misfit(training, robot, usual_noise(training), NOMINAL_FREE, effects=tuple(effects))
