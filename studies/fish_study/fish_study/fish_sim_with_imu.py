# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""fish_sim as a plant of the study: other numbers of links, steps and integrators than the tool's, any concealed effect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.step import Stepper
from fish_sim.water_push import WaterPush
from fish_study.swim import Inertial
from fish_study.trials import PERIOD

Array = NDArray[np.float64]

WRENCH = ("disturbance.surge", "disturbance.sway", "disturbance.yaw")


class FishSimWithImu:
    """`count` equal fish, pushed by the water each in its own way."""

    def __init__(
        self, robot: Robot, scheme: Scheme, count: int, noise: float, random: np.random.Generator
    ) -> None:
        robot = robot.with_effect("disturbance")
        self._stepper = Stepper(robot.structure, scheme)
        self._p = np.tile(self._stepper.parameters(robot), (count, 1))
        layout = self._stepper.layout
        self._pushed = [layout.parameters.index(name) for name in WRENCH]
        self._nx, self._nq, self._random, self._water = (
            len(layout.motion),
            layout.links + 3,
            random,
            WaterPush.usual(noise),
        )
        self.reset(np.zeros((count, 3)))

    def reset(self, poses: Array) -> None:
        """All at rest."""
        self.state = np.array(
            [self._stepper.rest(tuple(pose), parameters=self._p[0]) for pose in poses]
        )
        self._push = self._water.first(self._random.standard_normal((len(poses), 3)))

    def step(self, commands: Array) -> Inertial:
        """One period under the water's push."""
        self._p[:, self._pushed] = self._push
        before, nx = self.state, self._nx
        self.state = self._stepper.step(before, commands, self._p)
        self._push = self._water.after(self._push, self._random.standard_normal(self._push.shape))
        drive = (
            before[:, nx : nx + 2],
            (self.state[:, nx : nx + 2] - before[:, nx : nx + 2]) / PERIOD,
        )
        return self.inertial(
            before,
            np.stack([drive[0][:, 0], drive[1][:, 0], drive[0][:, 1], drive[1][:, 1]], axis=-1),
        )

    def inertial(self, state: Array, drive: Array) -> Inertial:
        """Rates and accelerations of the head in states (M, NS) under drives (M, 4)."""
        motion = np.ascontiguousarray(state[:, : self._nx])
        zeros = np.zeros_like(motion), np.zeros_like(drive), np.zeros_like(self._p)
        rates, _ = self._stepper.rates_jvp(motion, drive, self._p, *zeros)
        ax, ay = rates[:, self._nq], rates[:, self._nq + 1]
        cos, sin = np.cos(state[:, 2]), np.sin(state[:, 2])
        return Inertial(state[:, self._nq + 2], ax * cos + ay * sin, ay * cos - ax * sin)

    @property
    def pose(self) -> Array:
        """Of the heads."""
        return self.state[:, :3]

    @property
    def rotor_speed(self) -> Array:
        """As the motor turns."""
        return self.state[:, self._nx + 1]
