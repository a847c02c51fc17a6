"""Cuts a program of stroke and rudder into swims that the pool has room for, each from a place of its own.

A straight run of forty seconds is ten metres long. The model foretells the way from rest, however far the model is from the
robot; the exciter's guard is there for the rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.excitation import Excitation, Program, ProgramError
from fish_control.placement import find_start
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.step import Stepper

Array = NDArray[np.float64]

MARGIN = 0.35  # m, from the walls
COAST = 3.0  # s, the fish glides on after its last stroke
SHORTEST = 3.0  # s, a swim that tells anything
STEP = 1.0  # s, by which a swim is made shorter until it fits


@dataclass(frozen=True)
class Excursion:
    """One swim: which part of the program, and where the fish is put."""

    begin: float  # s of the program
    end: float  # s of the program
    x: float  # m
    y: float  # m
    heading: float  # rad


def excursions(program: Program, robot: Robot, begin: float = 0.0) -> Iterator[Excursion]:
    """All swims of a program from `begin` [s] on, one after the other."""
    while program.duration - begin >= SHORTEST:
        found = next_excursion(program, begin, robot)
        yield found
        begin = found.end


def next_excursion(program: Program, begin: float, robot: Robot, seed: int = 0) -> Excursion:
    """The longest swim from `begin` [s] of the program that stays in the pool.

    Raises:
        ProgramError: not even SHORTEST of it does.
    """
    random = np.random.default_rng(seed)
    for end in np.arange(program.duration, begin + SHORTEST - 1e-9, -STEP):
        start = find_start(predicted_way(program, begin, float(end), robot), random, MARGIN)
        if start is not None:
            x, y, heading = map(float, start)
            return Excursion(begin, float(end), x, y, math.remainder(heading, 2.0 * math.pi))
    raise ProgramError(
        f"from {begin:g} s on the fish needs more room within {SHORTEST:g} s than the pool has with {MARGIN:g} m to the walls; "
        "lower the amplitude"
    )


def predicted_way(program: Program, begin: float, end: float, robot: Robot) -> Array:
    """Poses (T, 3) of the head from the origin, at rest, until the fish has glided to its end."""
    excitation = Excitation(program, begin, end)
    commands = [excitation.command(DT) for _ in range(round((end - begin + COAST) / DT))]
    stepper = Stepper.of(robot)
    parameters = stepper.parameters(robot)
    table = np.array([[c.rotor_speed, c.alpha] for c in commands])
    way: Array = stepper.rollout(stepper.rest(parameters=parameters), table, parameters)[:, :3]
    return way
