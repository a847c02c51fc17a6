# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""All symmetry tests of an experiment: seconds, without a model of the fish."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import align, moved_back
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.symmetry.accelerometer import accelerations, marker_or_imu
from fish_sysid.diagnosis.symmetry.clocks import camera_clock, encoder_clock, imu_clock
from fish_sysid.diagnosis.symmetry.finding import SymmetryFinding
from fish_sysid.diagnosis.symmetry.galilei import UNIFORM_FLOW
from fish_sysid.diagnosis.symmetry.mirror import MIRROR
from fish_sysid.diagnosis.symmetry.place import PATCH, VARYING_FLOW, WALL_EFFECT
from fish_sysid.diagnosis.symmetry.scales import GYRO_SCALE, HEADING_OFFSET
from fish_sysid.diagnosis.symmetry.stroke_means import stroke_means

REGRESSIONS = (UNIFORM_FLOW, GYRO_SCALE, HEADING_OFFSET, VARYING_FLOW, WALL_EFFECT, PATCH, MIRROR)
GIVEN = "the given robot has it, and its values are refitted"
CONTAINED_IN = {"current": "nonuniform_current"}  # a flow that varies has a mean


def symmetry_findings(experiment: Experiment, robot: Robot) -> tuple[SymmetryFinding, ...]:
    """Every test's answer. Images are first moved back by the delay that camera and gyro show.

    What the given robot already has is found as any other, with that as `reason`.
    """
    alignment = align(experiment)
    timed = moved_back(experiment, alignment.delay)
    trials = stroke_means(timed)
    flow, gyro, marker, *others = (test.find(trials) for test in REGRESSIONS)
    scale, axes = accelerations(timed)
    clocks = camera_clock(experiment, alignment), encoder_clock(experiment), imu_clock(experiment)
    findings = (flow, *clocks, gyro, scale, *marker_or_imu(marker, axes), *others)
    own = {*robot.effects, *robot.sensors}
    return tuple(
        replace(f, reason=GIVEN) if f.status == "found" and in_any(f.name, own) else f
        for f in findings
    )


def in_any(name: str, names: Collection[str]) -> bool:
    """Whether one of the names is this one, or has it in it."""
    return name in names or CONTAINED_IN.get(name) in names
