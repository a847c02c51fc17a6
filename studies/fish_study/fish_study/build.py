# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From a scenario to its recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.excursions import find_start
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.sensors import SENSOR_EFFECTS
from fish_study.data_set import write_data_set
from fish_study.fish_sim_with_imu import FishSimWithImu
from fish_study.out_of_vocabulary import PLANT_EFFECTS
from fish_study.scenario import Scenario, ScenarioError
from fish_study.sensor_models import SensorErrors, SensorModels
from fish_study.swim import (
    SHORTEST,
    PlantWithImu,
    Readings,
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
MakePlant = Callable[[int], PlantWithImu]  # number of fish -> plant

TRIES = 12  # to find programs that keep the fish off the walls
SLOWER = 0.85  # factor on the rotor's speed at every new try


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
