# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Cuts a program of stroke and rudder into swims that the pool has room for, each from a place of its own.

A straight run of forty seconds is ten metres long. A model predicts the way from rest; where the robot swims elsewhere, the
exciter's guard ends the swim.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.excitation import Program, ProgramError, command_table
from fish_control.pool import HALF_LENGTH, HALF_WIDTH

Array = NDArray[np.float64]


HEADINGS = 60  # tried for a start


def find_start(way: Array, random: np.random.Generator, margin: float) -> Array | None:
    """A pose (3,) from which a way (T, 3), swum from the origin, keeps `margin` [m] from all walls; None if none was found."""
    half = np.array([HALF_LENGTH - margin, HALF_WIDTH - margin])
    for heading in random.uniform(-np.pi, np.pi, HEADINGS):
        cos, sin = np.cos(heading), np.sin(heading)
        x, y = way[:, 0] * cos - way[:, 1] * sin, way[:, 0] * sin + way[:, 1] * cos
        low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
        if np.all(high - low < 2.0 * half):
            place = random.uniform(-half - low, half - high)
            return np.array([*place, heading])
    return None


Way = Callable[[Array], Array]  # commands (T, 2) -> poses (T', 3) from rest at the origin

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


def excursions(
    program: Program, way: Way, begin: float = 0.0, margin: float = MARGIN
) -> Iterator[Excursion]:
    """All swims of a program from `begin` [s] on, one after the other, `margin` [m] from the walls."""
    while program.duration - begin >= SHORTEST:
        found = next_excursion(program, begin, way, margin=margin)
        yield found
        begin = next_begin(program, found.end)


def next_begin(program: Program, reached: float) -> float:
    """Where the next swim begins [s]: where the last one ended, or after what is too short for a swim of its own."""
    end = program.end_of_swim(reached)
    return end if end < program.duration and end - reached < SHORTEST else reached


def next_excursion(
    program: Program, begin: float, way: Way, seed: int = 0, margin: float = MARGIN
) -> Excursion:
    """The longest swim from `begin` [s] of the program, of one of its swims, that stays in the pool.

    Raises:
        ProgramError: not even SHORTEST of it does.
    """
    random = np.random.default_rng(seed)
    for end in np.arange(program.end_of_swim(begin), begin + SHORTEST - 1e-9, -STEP):
        table = command_table(program, begin, float(end), COAST)
        start = find_start(way(table), random, margin)
        if start is not None:
            x, y, heading = map(float, start)
            return Excursion(begin, float(end), x, y, math.remainder(heading, 2.0 * math.pi))
    raise ProgramError(
        f"from {begin:g} s on the fish needs more room within {SHORTEST:g} s than the pool has with {margin:g} m to the walls; "
        "lower the amplitude"
    )
