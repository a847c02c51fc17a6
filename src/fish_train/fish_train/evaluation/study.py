# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Runs of candidates under conditions over cells, in batches and processes; rows of metrics come back."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from fish_report.parallel import worker_pool
from fish_sim.robot import Robot
from fish_sim.sensors.settings import SensorSettings
from fish_train.evaluation.candidates import Candidate
from fish_train.evaluation.cells import (
    Cell,
    longest,
    read_path,
    start_pose,
)
from fish_train.evaluation.follow import ErrorSizes, RunMetrics, Trace, follow, measure
from fish_train.evaluation.plant import FishSimPlant, FusedSensing, PerfectSensing, Plant, Sensing
from fish_train.training.curriculum import CERTAIN

LARGEST_BATCH = 16  # runs
MakePlant = Callable[[Sequence[Robot], Sequence[int], float], Plant]


@dataclass(frozen=True)
class Condition:
    """A plant and its sensing."""

    name: str = "nominal"
    robot: Robot = field(default_factory=Robot)
    off: float = 0.0  # relative half-width of the uncertain parameters, drawn by the seed
    fused: bool = True  # sensors and fusion; False: perfect state
    sensors: SensorSettings = field(default_factory=SensorSettings)
    disturbance: float = 0.002  # N, as in the simulator node
    plant: MakePlant = FishSimPlant


@dataclass(frozen=True)
class Row:
    """One run with its metrics."""

    candidate: str
    condition: str
    cell: Cell
    metrics: RunMetrics


def detuned(robot: Robot, off: float, seed: int) -> Robot:
    """Uncertain parameters multiplied by a uniform 1 +- off."""
    if off == 0.0:
        return robot
    random = np.random.default_rng([seed, 4])
    factors = {
        k: 1.0 + off * random.uniform(-1.0, 1.0) for k in robot.parameters if k not in CERTAIN
    }
    return robot.with_parameters(
        **{k: robot.parameters[k] * factor for k, factor in factors.items()}
    )


def swim(candidate: Candidate, condition: Condition, cells: Sequence[Cell]) -> Trace:
    """All cells at once."""
    paths = [read_path(cell.path) for cell in cells]
    seeds = [cell.seed for cell in cells]
    robots = [detuned(condition.robot, condition.off, seed) for seed in seeds]
    plant = condition.plant(robots, seeds, condition.disturbance)
    sensing: Sensing = (
        FusedSensing(robots, seeds, condition.sensors) if condition.fused else PerfectSensing()
    )
    speed = np.array([cell.speed for cell in cells])
    starts = np.array([start_pose(path, seed) for path, seed in zip(paths, seeds, strict=True)])
    durations = np.array([longest(path, v) for path, v in zip(paths, speed, strict=True)])
    return follow(plant, sensing, candidate.gains, paths, speed, starts, durations, candidate.law)


def evaluate(candidate: Candidate, condition: Condition, cells: Sequence[Cell]) -> list[Row]:
    """Metrics of all cells."""
    trace = swim(candidate, condition, cells)
    return [
        Row(candidate.name, condition.name, cell, measure(trace, k, read_path(cell.path)))
        for k, cell in enumerate(cells)
    ]


def run_study(
    candidates: Sequence[Candidate],
    conditions: Sequence[Condition],
    cells: Sequence[Cell],
    jobs: int,
    report: Callable[[int, int], None] | None = None,
    keep: Callable[[int, list[Row]], object] | None = None,
) -> list[Row]:
    """Every candidate under every condition on every cell, in `jobs` processes; cells of similar duration swim together.

    keep: called with the place in the order and the rows of each batch when it is finished.
    """
    tasks = [
        (c, d, batch) for c in candidates for d in conditions for batch in _batches(cells, jobs)
    ]
    if jobs > 1:
        found = _in_processes(evaluate, tasks, jobs, report, keep)
        return [row for rows in found for row in rows]
    rows: list[Row] = []
    for done, task in enumerate(tasks, start=1):
        batch = evaluate(*task)
        rows += batch
        if keep is not None:
            keep(done - 1, batch)
        if report is not None:
            report(done, len(tasks))
    return rows


def _batches(cells: Sequence[Cell], jobs: int) -> list[list[Cell]]:
    """Cells of similar duration together, no batch longer than needed to occupy every process."""
    ordered = sorted(cells, key=lambda cell: longest(read_path(cell.path), cell.speed))
    size = max(1, min(LARGEST_BATCH, -(-len(ordered) // jobs)))
    return [ordered[k : k + size] for k in range(0, len(ordered), size)]


def _in_processes(
    work: Callable[..., Any],
    tasks: Sequence[tuple[Any, ...]],
    jobs: int,
    report: Callable[[int, int], None] | None = None,
    keep: Callable[[int, Any], object] | None = None,
) -> list[Any]:
    """work(*task) for every task, one core for each process; results in order, `keep` gets each with its place when it ends."""
    with worker_pool(jobs) as pool:
        places = {pool.submit(work, *task): place for place, task in enumerate(tasks)}
        for done, future in enumerate(as_completed(places), start=1):
            result = future.result()
            if keep is not None:
                keep(places[future], result)
            if report is not None:
                report(done, len(tasks))
    return [future.result() for future in places]


def swim_all(
    candidate: Candidate, condition: Condition, cells: Sequence[Cell], jobs: int
) -> tuple[list[tuple[Cell, Trace, int]], list[Row]]:
    """Traces and metrics of all cells: (cell, trace of its batch, place in the batch)."""
    batches = _batches(cells, jobs)
    tasks = [(candidate, condition, batch) for batch in batches]
    traces = [swim(*task) for task in tasks] if jobs == 1 else _in_processes(swim, tasks, jobs)
    swum = [
        (cell, trace, k)
        for batch, trace in zip(batches, traces, strict=True)
        for k, cell in enumerate(batch)
    ]
    rows = [
        Row(candidate.name, condition.name, cell, measure(trace, k, read_path(cell.path)))
        for cell, trace, k in swum
    ]
    return swum, rows


def mean_sizes(sizes: Sequence[ErrorSizes]) -> ErrorSizes:
    """Field by field over runs; NaN runs count as NaN."""
    return ErrorSizes(
        *(float(np.mean([getattr(s, f.name) for s in sizes])) for f in fields(ErrorSizes))
    )


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """All runs as CSV."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        table: csv.DictWriter[str] | None = None
        for row in rows:
            values = {"candidate": row.candidate, "condition": row.condition, **asdict(row.cell)}
            values |= {"approach": row.metrics.approach, "failure": row.metrics.failure}
            values |= {f"settled_{k}": v for k, v in asdict(row.metrics.settled).items()}
            values |= {f"whole_{k}": v for k, v in asdict(row.metrics.whole).items()}
            if table is None:
                table = csv.DictWriter(stream, list(values))
                table.writeheader()
            table.writerow(values)


ROBUST_OFF = 0.3  # of the uncertain parameters
ROBUST_LATENCY = 0.3  # s, of the camera
ROBUST_CURRENT = 0.03  # m/s, across the pool's long side


def make_condition(
    robot: Robot,
    off: float = 0.0,
    current: float = 0.0,
    latency: float | None = None,
    perfect: bool = False,
) -> Condition:
    """A named condition; what is not given stays as in the simulator node.

    Raises:
        ValueError: a value out of range; says what came and what was expected.
    """
    if not 0.0 <= off < 1.0:
        raise ValueError(f"off: got {off:g}; expected a share from 0 to below 1 (0.3 is 30 %)")
    parts = [robot.name if robot != Robot() else "nominal"]
    if perfect:
        parts.append("perfect state" if current else "perfect state, still water")
    if off:
        parts.append(f"parameters off by up to {off:.0%}")
    if current:
        robot = robot.with_effect("current", x=0.0, y=current)
        parts.append(f"current {current:g} m/s")
    sensors = SensorSettings()
    if latency is not None:
        sensors = replace(sensors, camera_latency=latency)
        parts.append(f"camera latency {latency:g} s")
    return Condition(
        name=", ".join(parts),
        robot=robot,
        off=off,
        fused=not perfect,
        sensors=sensors,
        disturbance=0.0 if perfect else Condition.disturbance,
    )


def robust_conditions(robot: Robot) -> list[Condition]:
    """Nominal, and one thing wrong at a time."""
    return [
        make_condition(robot),
        make_condition(robot, off=ROBUST_OFF),
        make_condition(robot, latency=ROBUST_LATENCY),
        make_condition(robot, current=ROBUST_CURRENT),
    ]
