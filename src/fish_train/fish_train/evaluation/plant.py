# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What swims and what is seen of it: a batch of robots that take a command every 10 ms, and the sensing of their motion.

The built-in plant is the project's simulator; another engine plugs in by offering the same three members. The control law
sees the true motion, or what sensors and fusion estimate of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fish_control.fusion import Fusion
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.scheme import stable_scheme
from fish_sim.sensors.distortion import SensorDistortion
from fish_sim.sensors.onboard import Imu
from fish_sim.sensors.overhead_camera import OverheadCamera
from fish_sim.sensors.settings import SensorSettings
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


class Sensing(Protocol):
    """Sees B robots."""

    def update(self, time: float, motion: Array) -> tuple[Array, NDArray[np.bool_]]:
        """True motion (B, 6) at `time` [s] -> motion as seen (B, 6), and whether there is one (B,)."""


class PerfectSensing:
    """The truth, at once."""

    def update(self, time: float, motion: Array) -> tuple[Array, NDArray[np.bool_]]:  # noqa: ARG002
        """Nothing is added."""
        return motion, np.ones(len(motion), dtype=bool)


class FusedSensing:
    """Overhead camera (noise, jitter, loss, latency), IMU (noise, bias) and the robot's own fusion, for each robot."""

    def __init__(
        self, robots: Sequence[Robot], seeds: Sequence[int], settings: SensorSettings | None = None
    ) -> None:
        settings = settings or SensorSettings()
        self._robots = [
            _SensedRobot(robot, seed, settings) for robot, seed in zip(robots, seeds, strict=True)
        ]

    def update(self, time: float, motion: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Every robot's estimate."""
        seen = [robot.update(time, row) for robot, row in zip(self._robots, motion, strict=True)]
        known = np.array([estimate is not None for estimate in seen])
        return np.array([np.zeros(6) if estimate is None else estimate for estimate in seen]), known


class _SensedRobot:
    """Sensors and fusion of one robot."""

    def __init__(self, robot: Robot, seed: int, settings: SensorSettings) -> None:
        random = np.random.default_rng([seed, 2])
        self._distortion = SensorDistortion(robot.sensors)
        self._imu = Imu(settings, random, self._distortion.imu_delay())
        self._camera = OverheadCamera(settings, self._distortion, random)
        self._fusion = Fusion()
        self._velocity: tuple[float, float] | None = None

    def update(self, time: float, motion: Array) -> Array | None:
        x, y, heading, _, _, rate = map(float, motion)
        force = self._specific_force(motion)
        ahead, left, turn = self._distortion.imu(*force, rate)
        sample = self._imu.measure((ahead, left), turn, heading, DT)
        for pose in self._camera.update(time, x, y, heading):
            self._fusion.add_pose(pose.stamp, np.array([pose.x, pose.y, pose.heading]))
        self._fusion.add_imu(time, sample.angular_velocity[2], *sample.specific_force[:2])
        estimate = self._fusion.estimate()
        return None if estimate is None else np.concatenate([estimate.pose, estimate.twist])

    def _specific_force(self, motion: Array) -> tuple[float, float]:
        """What an IMU's filter sees of a period: change of the velocity over ground, in base_link."""
        _, _, heading, u, v, _ = map(float, motion)
        cos, sin = math.cos(heading), math.sin(heading)
        vx, vy = cos * u - sin * v, sin * u + cos * v
        before = self._velocity or (vx, vy)
        self._velocity = (vx, vy)
        ax, ay = (vx - before[0]) / DT, (vy - before[1]) / DT
        return cos * ax + sin * ay, cos * ay - sin * ax
