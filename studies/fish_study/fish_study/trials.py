# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands of the trials of a data set: open-loop programs, and paths under feedback."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.controller import Controller, Reference
from fish_control.fusion import Fusion
from fish_control.hand_tuned import hand_tuned_policy
from fish_control.line_of_sight import Motion
from fish_control.paths import make_path
from fish_control.planner import Planner
from fish_control.policy import Policy
from fish_control.reference_path import ReferencePath
from fish_sysid.dataset.synthetic import FULL_SPEED, STROKE, program

Array = NDArray[np.float64]
Pose = tuple[float, float, float, float]  # stamp [s], x, y [m], heading [rad]

PERIOD = 0.01  # s, of the commands
OPEN = ("straight", "steps", "sines", "turn", "random", "straight", "sines", "random")
CLOSED = ("circle", "figure_eight", "oval", "circle")
ONE_SPEED = 0.15  # throttle of all trials that keep to one speed
SPEEDS = (0.08, 0.2)  # m/s, under feedback
OFF_PATH = 0.15  # m, a run under feedback starts about this far from its path
MARGIN = 0.08  # m, from the walls, of a fish that swims open loop


@dataclass(frozen=True)
class OpenLoop:
    """Commands that do not look: (T, M, 2) rotor speed [rad/s], rudder [rad]."""

    table: Array

    def command(self, k: int) -> tuple[Array, Array]:
        """Commands (M, 2) and rotor phases (M,) at grid point k."""
        phase = np.full(
            self.table.shape[1], np.remainder(2.0 * np.pi * STROKE * PERIOD * k, 2.0 * np.pi)
        )
        return self.table[k], phase

    def observe(self, k: int, gyro: Array, accel: Array, poses: Sequence[Sequence[Pose]]) -> None:
        """Nothing is done with it."""


class Feedback:
    """Fusion, planner and controller of fish_control, one of each per fish."""

    def __init__(
        self, paths: Sequence[ReferencePath], speeds: Sequence[float], policy: Policy | None = None
    ) -> None:
        policy = policy or hand_tuned_policy()
        self._fish = [
            _ClosedLoop(Planner(path, speed), Controller(policy))
            for path, speed in zip(paths, speeds, strict=True)
        ]

    def command(self, k: int) -> tuple[Array, Array]:
        """Commands (M, 2) and rotor phases (M,) at grid point k."""
        rows = np.array([fish.command(k) for fish in self._fish])
        return rows[:, 1:], rows[:, 0]

    def observe(self, k: int, gyro: Array, accel: Array, poses: Sequence[Sequence[Pose]]) -> None:
        """IMU samples of grid point k, and the camera poses (stamp, x, y, heading) that arrived until the next."""
        for m, fish in enumerate(self._fish):
            fish.observe(k * PERIOD, float(gyro[m]), accel[m], poses[m])


class _ClosedLoop:
    def __init__(self, planner: Planner, controller: Controller) -> None:
        self._planner, self._controller, self._fusion = planner, controller, Fusion()
        self._motion: Motion | None = None

    def observe(self, time: float, gyro: float, accel: Array, poses: Sequence[Pose]) -> None:
        for stamp, *pose in poses:
            self._fusion.add_pose(stamp, pose)
        self._fusion.add_imu(time, gyro, float(accel[0]), float(accel[1]))
        estimate = self._fusion.estimate()
        if estimate is None:
            return
        self._motion = Motion(*map(float, (*estimate.pose, *estimate.twist)))
        self._planner.observe(estimate.time, self._motion)
        self._controller.observe(estimate.time, self._motion)

    def command(self, k: int) -> tuple[float, float, float]:
        if self._motion is not None and k % 2 == 0:
            plan = self._planner.plan(self._motion)
            if plan.speed > 0.0:
                errors = plan.errors
                self._controller.decide(
                    Reference(errors.course, plan.speed, plan.yaw_rate, errors.cross_track)
                )
            else:
                self._controller.rest()
        command = self._controller.command(PERIOD)
        return command[0], command[1], command[2]


def open_loop(
    kinds: Iterable[str], duration: float, random: np.random.Generator, calm: Array
) -> Array:
    """Commands (T, M, 2) of open-loop programs, rotor slowed by `calm` (M,)."""
    table = np.stack([program(kind, duration, random) for kind in kinds], axis=1)
    return table * np.stack([calm, np.ones_like(calm)], axis=-1)


def at_one_speed(table: Array, calm: Array) -> Array:
    """The same programs with one amplitude of the rotor from the first second on, slowed by `calm` (M,)."""
    t = PERIOD * np.arange(len(table))
    amplitude = FULL_SPEED * np.sqrt(ONE_SPEED) * np.minimum(1.0, t)
    rotor = amplitude * np.sin(2.0 * np.pi * STROKE * t)
    return np.stack([rotor[:, None] * calm, table[..., 1]], axis=-1)


def feedback_paths(
    kinds: Sequence[str], random: np.random.Generator
) -> tuple[list[ReferencePath], list[float], Array]:
    """Paths, speeds and start poses (M, 3) near the paths."""
    paths, speeds, starts = [], [], []
    for kind in kinds:
        path = _path(kind, random)
        s = random.uniform(0.0, 1.0) * path.length
        (x, y), heading = path.point(s), float(path.heading_at(s))
        aside = OFF_PATH * random.uniform(-1.0, 1.0)
        starts.append(
            [
                x - aside * np.sin(heading),
                y + aside * np.cos(heading),
                heading + 0.3 * random.standard_normal(),
            ]
        )
        paths.append(path)
        speeds.append(float(random.uniform(*SPEEDS)))
    return paths, speeds, np.array(starts)


def _path(kind: str, random: np.random.Generator) -> ReferencePath:
    """One of CLOSED, its size and place drawn."""
    if kind == "figure_eight":
        return make_path(
            kind, length=float(random.uniform(2.2, 2.8)), width=float(random.uniform(0.9, 1.2))
        )
    if kind == "circle":
        return make_path(
            kind,
            radius=float(random.uniform(0.45, 0.7)),
            x=float(random.uniform(-0.8, 0.8)),
            direction=int(random.choice([-1, 1])),
        )
    if kind != "oval":
        raise ValueError(f"path: got {kind!r}; expected one of {', '.join(CLOSED)}")
    t = np.linspace(0.0, 2.0 * np.pi, 4097)[:-1]
    a, b = random.uniform(0.9, 1.4), random.uniform(0.5, 0.7)
    return ReferencePath.from_points(
        np.column_stack([a * np.cos(t), b * np.sin(t)]), name="oval", closed=True
    )
