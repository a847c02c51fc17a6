# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The way of a fish that swims from rest at the origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sim.step import Stepper

Array = NDArray[np.float64]


def way_from_rest(robot: Robot, commands: Array) -> Array:
    """Poses (T + 1, 3) of the head, x, y [m], heading [rad], under commands (T, 2) of rotor speed [rad/s] and rudder [rad]."""
    stepper = Stepper.of(robot)
    parameters = stepper.parameters(robot)
    way: Array = stepper.rollout(stepper.rest(parameters=parameters), commands, parameters)[:, :3]
    return way
