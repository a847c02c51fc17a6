"""From a world to its recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.placement import find_start
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme
from fish_sim.sensors import SENSOR_EFFECTS
from fish_study.data_set import write_data_set
from fish_study.fish_sim_plant import FishSimPlant
from fish_study.out_of_vocabulary import PLANT_EFFECTS
from fish_study.scenario import NoWorld, World
from fish_study.sensor_models import Errors, Instruments
from fish_study.swim import Plant, Readings, swim
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
MakePlant = Callable[[int], Plant]  # number of fish -> plant

TRIES = 12  # to find programs that keep the fish off the walls
SLOWER = 0.85  # factor on the rotor's speed at every new try


def true_robot(world: World) -> Robot:
    """The fish of a fish_sim world, with what is concealed in it."""
    robot = Robot(links=world.links, table=PLANT_EFFECTS)
    values = {name: robot.parameters[name] * factor for name, factor in world.parameters.items()}
    robot = robot.with_parameters(**values)
    for name, effect in world.effects.items():
        robot = robot.with_effect(name, **effect)
    return robot


def make_world(world: World, folder: Path) -> None:
    """Write the recordings of a world into a new folder, one directory per trial."""
    write_data_set(folder, make_readings(world), encoder=world.encoder)


def make_readings(world: World) -> list[Readings]:
    """The trials of a world: open loop first, then under feedback.

    Raises:
        NoWorld: no program keeps the fish off the walls, or the engine became unstable.
        ValueError: the plant is not known.

    """
    random = np.random.default_rng(world.seed)
    if world.plant == "fish_sim":
        robot, scheme = true_robot(world), Scheme(world.method, world.substeps)
        errors = Errors.of({n: v for n, v in world.effects.items() if n in SENSOR_EFFECTS})

        def make(count: int) -> Plant:
            return FishSimPlant(robot, scheme, count, world.noise, random)

        return _trials(world, make, errors, random)
    if world.plant == "mujoco":
        from fish_study.mujoco_plant import MujocoPlant, instrument_errors

        return _trials(
            world,
            lambda count: MujocoPlant.of(world, count, random),
            instrument_errors(world),
            random,
        )
    raise ValueError(f"plant: got {world.plant!r}; expected fish_sim or mujoco")


def _trials(
    world: World, make: MakePlant, errors: Errors, random: np.random.Generator
) -> list[Readings]:
    steps = round(world.duration / PERIOD)
    closed = (
        world.count
        if world.trials == "closed"
        else 0
        if world.trials == "one_speed"
        else world.count // 3
    )
    readings = []
    if world.count > closed:
        readings.append(_open(world, make, errors, random, world.count - closed, steps))
    if closed:
        kinds = [CLOSED[i % len(CLOSED)] for i in range(closed)]
        paths, speeds, starts = feedback_paths(kinds, random)
        instruments = Instruments(steps, closed, world.noise, errors, random)
        readings.append(swim(make(closed), starts, Feedback(paths, speeds), instruments, steps))
    return readings


def _open(
    world: World,
    make: MakePlant,
    errors: Errors,
    random: np.random.Generator,
    count: int,
    steps: int,
) -> Readings:
    """A program whose way fits nowhere into the pool is drawn again, a little slower. Raises NoWorld after TRIES."""
    kinds = np.array([OPEN[i % len(OPEN)] for i in range(count)])
    calm, lost = np.ones(count), np.ones(count, dtype=bool)
    table, starts = np.zeros((steps, count, 2)), np.zeros((count, 3))
    for _ in range(TRIES):
        table[:, lost] = open_loop(kinds[lost], world.duration, random, calm[lost])
        if world.trials == "one_speed":
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
        raise NoWorld(
            f"{lost.sum()} of {count} trials of {world.duration:g} s fit nowhere into the pool, {TRIES} programs tried for each,"
            " every one slower: ask for shorter trials"
        )
    instruments = Instruments(steps, count, world.noise, errors, random)
    return swim(make(count), starts, OpenLoop(table), instruments, steps)


def _way(make: MakePlant, table: Array) -> Array:
    """(T, M, 3) poses from the pool's centre under commands (T, M, 2)."""
    plant = make(table.shape[1])
    poses = np.empty((*table.shape[:2], 3))
    for k, commands in enumerate(table):
        poses[k] = plant.pose
        plant.step(commands)
    return poses
