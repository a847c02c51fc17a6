# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fish without a controller: a rotor that swings, a rudder that stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.control_law import ControlLimits, amplitude_of_throttle
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper

Array = NDArray[np.float64]
SETTLING = 20.0  # s until the mean speed no longer changes
AVERAGING = 2.0  # s, four strokes


@dataclass(frozen=True)
class Swim:
    """(T,) time [s], (T, 3) x, y [m], heading [rad], (T, 3) surge, sway [m/s], yaw rate [rad/s]."""

    time: Array
    pose: Array
    velocity: Array


def swing(
    robot: Robot, amplitude: Array, frequency: float, seconds: float, rudder: float = 0.0
) -> list[Swim]:
    """Rotor speed A w sin(w t) for each amplitude A (B,) [rad], from rest at the origin."""
    stepper = Stepper.of(robot)
    time: Array = DT * np.arange(round(seconds / DT) + 1, dtype=float)
    w = 2.0 * np.pi * frequency
    speeds = np.asarray(amplitude)[None, :] * w * np.sin(w * time[1:, None])
    commands = np.stack([speeds, np.full_like(speeds, rudder)], axis=-1)
    start = np.tile(stepper.rest(), (len(amplitude), 1))
    states = stepper.rollout(start, commands, stepper.parameters(robot))
    size = stepper.layout.links + 3
    return [_swim(time, states[:, k], size) for k in range(len(amplitude))]


def speed_of_throttle(robot: Robot, throttle: Array, limits: ControlLimits) -> Array:
    """Mean surge speed [m/s] of steady swimming at throttles s (B,)."""
    amplitude = amplitude_of_throttle(np.asarray(throttle), limits, np)
    swims = swing(robot, amplitude, limits.frequency, SETTLING + AVERAGING)
    return np.array([swim.velocity[swim.time >= SETTLING, 0].mean() for swim in swims])


def _swim(time: Array, states: Array, size: int) -> Swim:
    cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
    vx, vy, rate = states[:, size : size + 3].T
    return Swim(
        time, states[:, :3], np.column_stack([cos * vx + sin * vy, cos * vy - sin * vx, rate])
    )
