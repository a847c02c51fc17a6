# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What swims: a batch of robots that take a command every 10 ms and have a true motion.

The built-in plant is the project's simulator; another engine plugs in by offering the same three members.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sim.scheme import stable_scheme
from fish_sim.step import Stepper
from fish_sim.water_push import WaterPush

Array = NDArray[np.float64]


class Plant(Protocol):
    """B robots in the water."""

    def reset(self, poses: Array) -> None:
        """Put the robots at rest at poses (B, 3): x [m], y [m], heading [rad], pool frame."""

    def step(self, commands: Array) -> None:
        """Follow commands (B, 2): rotor speed [rad/s], rudder [rad], for 10 ms."""

    @property
    def motion(self) -> Array:
        """True motion (B, 6): x, y [m], heading [rad, not wrapped], surge, sway [m/s], yaw rate [rad/s]."""


class FishSimPlant:
    """Robots of one structure in the simulator, each with its own parameters; `disturbance` [N] stirs the water."""

    def __init__(
        self, robots: Sequence[Robot], seeds: Sequence[int], disturbance: float = 0.0
    ) -> None:
        self._robots = [
            r.with_effect("disturbance", **r.effects.get("disturbance", {})) for r in robots
        ]
        schemes = [stable_scheme(robot) for robot in self._robots]
        self._stepper = Stepper.of(
            self._robots[0], max(schemes, key=lambda scheme: scheme.substeps)
        )
        self._still = np.array([self._stepper.parameters(robot) for robot in self._robots])
        names = self._stepper.layout.parameters
        self._pushed = [names.index(f"disturbance.{key}") for key in ("surge", "sway", "yaw")]
        self._random = [np.random.default_rng([seed, 1]) for seed in seeds]
        self._water = WaterPush.of_force(disturbance)
        self.reset(np.zeros((len(robots), 3)))

    def reset(self, poses: Array) -> None:
        """All robots at rest."""
        self._state = np.array(
            [
                self._stepper.rest(tuple(pose), parameters=p)
                for pose, p in zip(poses, self._still, strict=True)
            ]
        )
        self._push = np.zeros((len(poses), 3))

    def step(self, commands: Array) -> None:
        """Advance all robots; the water pushes as in `fish_sim.simulation`."""
        fresh = np.array([random.standard_normal(3) for random in self._random])
        self._push = self._water.after(self._push, fresh)
        parameters = self._still.copy()
        parameters[:, self._pushed] += self._push
        self._state = self._stepper.step(self._state, commands, parameters)

    @property
    def motion(self) -> Array:
        """From the head's coordinates and their rates."""
        size = self._stepper.layout.links + 3
        x, y, heading = self._state[:, :3].T
        vx, vy, rate = self._state[:, size : size + 3].T
        cos, sin = np.cos(heading), np.sin(heading)
        return np.column_stack([x, y, heading, cos * vx + sin * vy, cos * vy - sin * vx, rate])
