# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is swum: paths by name, speeds, seeds, and where a run starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import yaml

from fish_control.paths import make_path
from fish_control.planner import FASTEST, SLOWEST
from fish_control.reference_path import PathError, ReferencePath
from fish_report.errors import UserError

RUN_UP = 0.15  # m, runs start this far before their path
START_OFFSET = 0.01  # m, std of the start's distance from the path; seed 0 starts exactly
START_HEADING = 0.05  # rad, std
LAPS = 2.0  # of a closed path
SLACK = 1.5  # an open path may take this much longer than length / speed
STARTING = 8.0  # s, and this much more


@dataclass(frozen=True)
class Cell:
    """One run to be made."""

    path: str  # specification, see `read_path`
    speed: float  # m/s
    seed: int


def read_path(specification: str) -> ReferencePath:
    """`R`, or `family` with arguments: `sinusoid:amplitude=0.5,cycles=1`, `circle:radius=0.6`."""
    family, _, text = specification.partition(":")
    arguments = {}
    for part in filter(None, text.split(",")):
        name, equals, value = part.partition("=")
        if not equals:
            raise UserError(f"path {specification!r}: got {part!r}; expected NAME=VALUE")
        try:
            arguments[name.strip()] = yaml.safe_load(value)
        except (yaml.YAMLError, ValueError):  # ValueError: a date that is none, 2020-13-45
            raise UserError(
                f"path {specification!r}: got {value!r} as {name.strip()}; expected a number or a word"
            ) from None
    try:
        return make_path(family, **arguments)
    except PathError as error:
        raise UserError(str(error)) from error


def make_cells(paths: Sequence[str], speeds: Sequence[float], seeds: Sequence[int]) -> list[Cell]:
    """Every path at every speed with every seed."""
    for speed in speeds:
        if not SLOWEST <= speed <= FASTEST:
            raise UserError(f"speed: got {speed} m/s; expected {SLOWEST} to {FASTEST}")
    return [Cell(path, speed, seed) for path in paths for speed in speeds for seed in seeds]


def start_pose(path: ReferencePath, seed: int) -> tuple[float, float, float]:
    """At rest before the path's beginning, scattered by the seed."""
    random = np.random.default_rng([seed, 3])
    offset, turn = random.standard_normal(2) * (
        [START_OFFSET, START_HEADING] if seed else [0.0, 0.0]
    )
    (x, y), heading = path.point(0.0), float(path.heading_at(0.0))
    along, left = (np.cos(heading), np.sin(heading)), (-np.sin(heading), np.cos(heading))
    return (
        float(x - RUN_UP * along[0] + offset * left[0]),
        float(y - RUN_UP * along[1] + offset * left[1]),
        heading + float(turn),
    )


def longest(path: ReferencePath, speed: float) -> float:
    """Duration of a run [s]."""
    if path.closed:
        return float(LAPS * path.length + RUN_UP) / speed + STARTING / 2
    return float(SLACK * (path.length + RUN_UP)) / speed + STARTING
