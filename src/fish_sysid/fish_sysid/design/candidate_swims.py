# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Swims from which a calibration is chosen: strokes and rudder patterns of several lengths that the pool has room for."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fish_control.excitation import FASTEST_ROTOR, Program, ProgramError, Row, command_table
from fish_control.excursions import COAST, excursions, find_start
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sim.way import way_from_rest
from fish_sysid.design.sensitivity import Swims, states

Array = NDArray[np.float64]

STROKES = (  # rad, Hz
    (5.0, 2.0),
    (8.0, 2.0),
    (11.5, 2.0),
    (9.5, 1.4),
    (7.0, 2.8),
)
RUDDERS = (0.2, 0.5, 0.8)  # rad
PERIODS = (1.5, 4.0)  # s, of rudder steps to both sides
RANDOM = 4  # swims whose stroke and rudder change every second
LENGTHS = (6.0, 9.0, 12.0, 16.0)  # s
USUAL, SOME = 12.0, 7  # s, and one of so many: swims of every kind
GLIDE = 0.5  # of a swim with a glide: when the strokes end
MARGIN = 0.4  # m, from the walls; wider than `excite` demands, since the robot is not the model


@dataclass(frozen=True)
class Candidate:
    """One swim from rest to rest."""

    what: str
    rows: tuple[Row, ...]  # from 0 s on
    length: float  # s, without the glide at its end


def candidates() -> list[Candidate]:
    """All patterns in all lengths."""
    longest = max(LENGTHS)
    patterns: list[tuple[str, list[Row]]] = []
    for a, f in STROKES:
        stroke = f"{a:g} rad at {f:g} Hz"
        patterns.append((f"{stroke}, straight", [Row(0.0, a, f, 0.0)]))
        for r in RUDDERS:
            patterns.append((f"{stroke}, turn {r:+g} rad", [Row(0.0, a, f, r)]))
            for period in PERIODS:
                sides = itertools.cycle((r, -r))
                # from half a period, as a swim to one side would be twice as wide
                times = np.arange(0.0, longest, period / 2.0)
                patterns.append(
                    (
                        f"{stroke}, rudder steps of {r:g} rad every {period / 2.0:g} s",
                        [Row(float(t), a, f, s) for t, s in zip(times, sides, strict=False)],
                    )
                )
    random = np.random.default_rng(0)
    for number in range(RANDOM):
        patterns.append((f"random strokes and rudder, number {number}", _random(longest, random)))
    whole = [Candidate(what, _until(rows, s), s) for what, rows in patterns for s in LENGTHS]
    return whole + [_glided(c) for c in whole if "straight" in c.what or "turn" in c.what]


def _random(longest: float, random: np.random.Generator) -> list[Row]:
    """A new stroke and rudder every second."""
    rows = []
    for t in np.arange(0.0, longest, 1.0):
        a, f = STROKES[random.integers(len(STROKES))]
        rows.append(Row(float(t), a, f, float(random.choice([-1, 1]) * random.choice(RUDDERS))))
    return rows


def _until(rows: list[Row], length: float) -> tuple[Row, ...]:
    return tuple(row for row in rows if row.t < length)


def _glided(candidate: Candidate) -> Candidate:
    """The same, with strokes in its first part only."""
    t = GLIDE * candidate.length
    last = candidate.rows[-1]
    rows = (*(row for row in candidate.rows if row.t < t), last._replace(t=t, amplitude=0.0))
    return Candidate(f"{candidate.what}, gliding from {t:g} s on", rows, candidate.length)


def swims_of(candidates: list[Candidate], start: Array | None = None) -> Swims:
    """Their commands until the fish has glided to its end; start (M, 3), by default at the origin."""
    tables = [command_table(Program(c.rows, (c.length,)), 0.0, c.length, COAST) for c in candidates]
    return side_by_side(tables, np.zeros((len(tables), 3)) if start is None else start)


def side_by_side(tables: list[Array], start: Array) -> Swims:
    """Commands (T_m, 2) of each swim, padded to the longest, from start poses (M, 3)."""
    steps = np.array([len(table) for table in tables])
    commands = np.zeros((int(steps.max()), len(tables), 2))
    for m, table in enumerate(tables):
        commands[: len(table), m] = table
    return Swims(commands, steps, start)


def placed(
    candidates: list[Candidate], robot: Robot, seed: int = 0
) -> tuple[list[Candidate], Swims]:
    """Those that the pool has room for, each from a place of its own, by the model."""
    swims, random = swims_of(candidates), np.random.default_rng(seed)
    way = states(robot, swims)[..., :3]
    starts = [find_start(way[: swims.steps[m], m], random, MARGIN) for m in range(len(candidates))]
    kept = [m for m, start in enumerate(starts) if start is not None]
    if not kept:
        raise ProgramError("the pool has no room for any of these swims; lower the amplitudes")
    found = np.array([starts[m] for m in kept])
    return [candidates[m] for m in kept], swims_of([candidates[m] for m in kept], found)


def swims_of_program(program: Program, robot: Robot) -> Swims:
    """A program as `excite` swims it with this robot. Raises ProgramError where the pool has no room."""
    cut = list(excursions(program, partial(way_from_rest, robot)))
    tables = [command_table(program, swim.begin, swim.end, COAST) for swim in cut]
    return side_by_side(tables, np.array([(swim.x, swim.y, swim.heading) for swim in cut]))


def swims_of_every_kind(robot: Robot) -> Swims:
    """About ten swims with all strokes, rudder steps, turns, glides and random ones."""
    return placed([c for c in candidates() if c.length == USUAL][::SOME], robot)[1]


def swim_seconds(swims: Swims) -> Array:
    """(M,) duration of each swim with its glide [s]."""
    return np.asarray(DT * swims.steps, dtype=float)


assert all(a * 2.0 * np.pi * f <= FASTEST_ROTOR for a, f in STROKES)
