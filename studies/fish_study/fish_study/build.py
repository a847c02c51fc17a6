# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From a scenario to its recordings; and fish_sim as a plant of the study.

That plant has other numbers of links, steps and integrators than the tool's, and any concealed effect.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.excursions import find_start
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.sensors import SENSOR_EFFECTS
from fish_sim.step import Stepper
from fish_sim.water_push import WaterPush
from fish_study.data_set import write_data_set
from fish_study.plant_effects import PLANT_EFFECTS
from fish_study.scenario import Scenario, ScenarioError
from fish_study.swim import (
    SHORTEST,
    Inertial,
    PlantWithImu,
    Readings,
    SensorErrors,
    SensorModels,
    ended_at_a_wall,
    kept_trials,
    swim,
)
from fish_study.trials import (
    CLOSED,
    MARGIN,
    OPEN,
    PERIOD,
    Feedback,
    OpenLoop,
    at_one_speed,
    feedback_paths,
    open_loop,
)

Array = NDArray[np.float64]

WRENCH = ("disturbance.surge", "disturbance.sway", "disturbance.yaw")
MakePlant = Callable[[int], PlantWithImu]  # number of fish -> plant

TRIES = 12  # to find programs that keep the fish off the walls
SLOWER = 0.85  # factor on the rotor's speed at every new try


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


def true_robot(scenario: Scenario) -> Robot:
    """The fish of a fish_sim scenario, with what is concealed in it."""
    robot = Robot(links=scenario.links, table=PLANT_EFFECTS)
    values = {name: robot.parameters[name] * factor for name, factor in scenario.parameters.items()}
    robot = robot.with_parameters(**values)
    for name, effect in scenario.effects.items():
        robot = robot.with_effect(name, **effect)
    return robot


def make_recordings(scenario: Scenario, folder: Path) -> dict[str, float]:
    """Write the recordings of a scenario into a new folder, one directory per trial.

    Returns:
        The trials that ended at a wall of the pool, and how long each lasted until then [s].

    Raises:
        ScenarioError: as `make_readings`, or every trial came to a wall at once.
    """
    readings = make_readings(scenario)
    at_wall = ended_at_a_wall(readings)
    if not kept_trials(readings):
        raise ScenarioError(
            f"all {len(at_wall)} trials came to a wall of the pool within {SHORTEST:g} s"
        )
    write_data_set(folder, readings, encoder=scenario.encoder)
    return at_wall


def make_readings(scenario: Scenario) -> list[Readings]:
    """The trials of a scenario: open loop first, then under feedback.

    Raises:
        ScenarioError: no program keeps the fish off the walls, or the engine became unstable.
        ValueError: the plant is not known.

    """
    random = np.random.default_rng(scenario.seed)
    if scenario.plant == "fish_sim":
        robot, scheme = true_robot(scenario), Scheme(scenario.method, scenario.substeps)
        errors = SensorErrors.of({n: v for n, v in scenario.effects.items() if n in SENSOR_EFFECTS})

        def make(count: int) -> PlantWithImu:
            return FishSimWithImu(robot, scheme, count, scenario.noise, random)

        return _trials(scenario, make, errors, random)
    if scenario.plant == "mujoco":
        from fish_study.mujoco_plant import MujocoPlant, sensor_errors

        return _trials(
            scenario,
            lambda count: MujocoPlant.of(scenario, count, random),
            sensor_errors(scenario),
            random,
        )
    raise ValueError(f"plant: got {scenario.plant!r}; expected fish_sim or mujoco")


def _trials(
    scenario: Scenario, make: MakePlant, errors: SensorErrors, random: np.random.Generator
) -> list[Readings]:
    steps = round(scenario.duration / PERIOD)
    closed = (
        scenario.count
        if scenario.trials == "closed"
        else 0
        if scenario.trials == "one_speed"
        else scenario.count // 3
    )
    readings = []
    if scenario.count > closed:
        readings.append(_open(scenario, make, errors, random, scenario.count - closed, steps))
    if closed:
        kinds = [CLOSED[i % len(CLOSED)] for i in range(closed)]
        paths, speeds, starts = feedback_paths(kinds, random)
        sensors = SensorModels(steps, closed, scenario.noise, errors, random)
        readings.append(swim(make(closed), starts, Feedback(paths, speeds), sensors, steps))
    return readings


def _open(
    scenario: Scenario,
    make: MakePlant,
    errors: SensorErrors,
    random: np.random.Generator,
    count: int,
    steps: int,
) -> Readings:
    """A program whose way fits nowhere into the pool is drawn again, a little slower. Raises ScenarioError after TRIES."""
    kinds = np.array([OPEN[i % len(OPEN)] for i in range(count)])
    calm, lost = np.ones(count), np.ones(count, dtype=bool)
    table, starts = np.zeros((steps, count, 2)), np.zeros((count, 3))
    for _ in range(TRIES):
        table[:, lost] = open_loop(kinds[lost], scenario.duration, random, calm[lost])
        if scenario.trials == "one_speed":
            table = at_one_speed(table, calm)
        which = np.flatnonzero(lost)
        ways = _way(make, table[:, which])
        for m, way in zip(which, np.moveaxis(ways, 1, 0), strict=True):
            start = find_start(way, random, MARGIN)
            lost[m] = start is None
            starts[m] = (0.0, 0.0, 0.0) if start is None else start
        if not lost.any():
            break
        calm[lost] *= SLOWER
    else:
        raise ScenarioError(
            f"{lost.sum()} of {count} trials of {scenario.duration:g} s fit nowhere into the pool, {TRIES} programs tried for"
            " each, every one slower: ask for shorter trials"
        )
    sensors = SensorModels(steps, count, scenario.noise, errors, random)
    return swim(make(count), starts, OpenLoop(table), sensors, steps)


def _way(make: MakePlant, table: Array) -> Array:
    """(T, M, 3) poses from the pool's centre under commands (T, M, 2)."""
    plant = make(table.shape[1])
    poses = np.empty((*table.shape[:2], 3))
    for k, commands in enumerate(table):
        poses[k] = plant.pose
        plant.step(commands)
    return poses
