# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the symmetry tests find goes into the robot, and a uniform flow out of the recordings."""

from __future__ import annotations

from collections.abc import Sequence

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import with_current
from fish_sysid.diagnosis.symmetry.finding import SymmetryFinding
from fish_sysid.diagnosis.symmetry.symmetry_json import stated
from fish_sysid.estimation.parametrization import effect_class

FLOW = "current"


def applicable(findings: Sequence[SymmetryFinding], robot: Robot) -> list[SymmetryFinding]:
    """Stated findings that give all parameters of an effect which the robot has not."""
    own = {*robot.effects, *robot.sensors}
    return [
        f
        for f in stated(findings)
        if f.name not in own
        and set(f.parameters) == set(effect_class(f.name, robot.table).parameters)
    ]


def with_findings(robot: Robot, findings: Sequence[SymmetryFinding]) -> Robot:
    """The robot with every applicable finding as an effect or sensor error, cut to the effect's range."""
    for finding in applicable(findings, robot):
        ranges = effect_class(finding.name, robot.table).parameters
        values = {
            key: float(min(max(p.value, ranges[key].lowest), ranges[key].highest))
            for key, p in finding.parameters.items()
        }
        robot = robot.with_effect(finding.name, **values)
    return robot


def in_still_water(experiment: Experiment, findings: Sequence[SymmetryFinding]) -> Experiment:
    """The recordings as the water sees them, where a uniform flow is stated (Galilei); otherwise as they are."""
    flow = next((f.parameters for f in stated(findings) if f.name == FLOW), None)
    if flow is None:
        return experiment
    return with_current(experiment, (-flow["x"].value, -flow["y"].value))
