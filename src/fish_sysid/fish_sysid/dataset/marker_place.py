# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Poses of the head's centre of mass from those of the point that the camera follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, Frames

Array = NDArray[np.float64]

MARKER, AHEAD = "camera_marker", "ahead"


def ahead_of(robot: Robot) -> float:
    """How far the point that the camera follows lies ahead of the head's centre of mass [m]."""
    return float(robot.sensors.get(MARKER, {}).get(AHEAD, 0.0))


def with_marker(robot: Robot, ahead: float) -> Robot:
    """The robot whose camera follows a point `ahead` [m] of the one that it followed; without the entry where that is 0."""
    place = ahead_of(robot) + ahead
    sensors = {name: values for name, values in robot.sensors.items() if name != MARKER}
    return replace(robot, sensors=sensors | ({MARKER: {AHEAD: place}} if place else {}))


def at_centre_of_mass(experiment: Experiment, ahead: float) -> Experiment:
    """The experiment as a camera would see it that follows the centre of mass, `ahead` [m] behind the point it follows."""
    if ahead == 0.0:
        return experiment
    frames = tuple(Frames(f.t, forward(f.pose, -ahead)) for f in experiment.frames)
    return replace(experiment, frames=frames)


def forward(pose: Array, ahead: float | Array) -> Array:
    """Poses (..., 3) of a point `ahead` [m] of another one on the same head; (...) or one for all."""
    moved = pose.copy()
    moved[..., 0] += ahead * np.cos(pose[..., 2])
    moved[..., 1] += ahead * np.sin(pose[..., 2])
    return moved
