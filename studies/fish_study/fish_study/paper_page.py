# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The paper's figures and table remade on one page, the paper's numbers beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fish_control.control_law import ControlLimits
from fish_report.page import (
    Block,
    Figure,
    Table,
    Text,
    write_page,
)
from fish_sim.robot import Robot
from fish_study import paper_numbers as paper
from fish_study.paper_figures import (
    gains_figure,
    path_figure,
    portrait_figure,
    throttle_figure,
    training_figure,
)
from fish_train.evaluation.candidates import Candidate
from fish_train.evaluation.cells import Cell, read_path
from fish_train.evaluation.follow import ErrorSizes, RunMetrics, Trace, measure
from fish_train.evaluation.open_loop import speed_of_throttle, swing
from fish_train.evaluation.study import Condition, Row, mean_sizes, swim
from fish_train.training.run_log import CurveRow

PORTRAIT_TIME = 20.0  # s
LIMIT_CYCLE = 2.0  # s at the end of it
GAINS_SPEED = 0.20  # m/s, of the letters whose gains are shown


def open_loop_blocks(robot: Robot) -> list[Block]:
    """Phase portrait and speed against throttle."""
    [portrait] = swing(
        robot, np.array([paper.PORTRAIT_AMPLITUDE]), paper.PORTRAIT_FREQUENCY, PORTRAIT_TIME
    )
    throttle = np.linspace(0.0, 1.0, 21)
    speed = speed_of_throttle(robot, throttle, ControlLimits())
    title = f"Open loop, A = {paper.PORTRAIT_AMPLITUDE:g} rad, f = {paper.PORTRAIT_FREQUENCY:g} Hz"
    return [
        Figure(title, portrait_figure(portrait, LIMIT_CYCLE)),
        Figure(
            "Speed against throttle",
            throttle_figure(throttle, speed),
            f"Full throttle: {speed[-1]:.2f} m/s.",
        ),
    ]


def training_blocks(curves: Sequence[Sequence[CurveRow]], levels: int) -> list[Block]:
    """The curve over seeds and how many came to the end; a seed rolled back to its beginning has no row to show."""
    title, drawn = f"Training, {len(curves)} seeds", [curve for curve in curves if curve]
    without = f"{len(curves) - len(drawn)} of {len(curves)} seeds diverged before their first checkpoint and have no curve."
    if not drawn:
        return [Text(title, without)]
    done = sum(curve[-1].level >= levels for curve in drawn)
    seconds = [curve[-1].seconds for curve in drawn]
    note = (
        f"{done} of {len(curves)} seeds passed all {levels} levels; {np.mean(seconds):.0f} s each on average "
        f"(longest {max(seconds):.0f} s)." + (f" {without}" if len(drawn) < len(curves) else "")
    )
    return [Figure(title, training_figure(drawn), note)]


def simulation_blocks(candidate: Candidate, condition: Condition) -> list[Block]:
    """Sinusoid and circle with perfect state."""
    cases = (paper.SINUSOID, paper.CIRCLE)
    cells = [Cell(case[0], case[1], 0) for case in cases]
    trace = swim(candidate, replace(condition, fused=False, disturbance=0.0), cells)
    blocks: list[Block] = []
    lines = []
    for k, (specification, speed, cross_track, speed_error) in enumerate(cases):
        path = read_path(specification)
        sizes = measure(trace, k, path).settled
        lines.append(
            [
                f"{specification}, {speed:g} m/s",
                f"{1e3 * sizes.cross_track_mean:.1f}",
                f"about {1e3 * cross_track:.0f}",
                f"{1e3 * sizes.speed_mean:.1f}",
                f"{1e3 * speed_error:.0f}",
            ]
        )
        title = f"{path.name.capitalize()} at {speed:g} m/s, perfect state"
        blocks.append(Figure(title, path_figure(path, [("simulated", trace.motion[:, k, :2])])))
        blocks.append(Figure(f"Gains, {path.name}", gains_figure(trace, k)))
    header = ["path", "mean |cross-track|, mm", "paper", "mean |speed error|, mm/s", "paper"]
    return [*blocks, Table("Simulation with perfect state", header, lines, "After the approach.")]


def letter_blocks(
    candidate: Candidate, condition: Condition, traces: Sequence[tuple[Cell, Trace, int]]
) -> list[Block]:
    """Letters swum through the full chain, and the gains on R and S."""
    blocks: list[Block] = []
    for letter in paper.LETTERS:
        chosen = [
            (c.speed, t.motion[:, k, :2]) for c, t, k in traces if c.path == letter and c.seed == 0
        ]
        lines = [
            (f"{speed:g} m/s", position)
            for speed, position in sorted(chosen, key=lambda item: item[0])
        ]
        blocks.append(Figure(f"Letter {letter}", path_figure(read_path(letter), lines)))
    for letter in ("R", "S"):
        for cell, trace, k in traces:
            if cell == Cell(letter, GAINS_SPEED, 0):
                blocks.append(
                    Figure(f"Gains on {letter} at {GAINS_SPEED:g} m/s", gains_figure(trace, k))
                )
    lead = f"{candidate.name}; {condition.name}: camera, IMU and fusion in the loop."
    return [Text("Full chain", lead), *blocks]


def error_table(rows: Sequence[Row]) -> Table:
    """The paper's table of the real robot beside our simulation of the full chain."""
    lines = []
    for letter in paper.LETTERS:
        for k, speed in enumerate(paper.SPEEDS):
            runs = [r.metrics for r in rows if (r.cell.path, r.cell.speed) == (letter, speed)]
            settled, whole = (
                mean_sizes([m.settled for m in runs]),
                mean_sizes([m.whole for m in runs]),
            )
            theirs = paper.CROSS_TRACK[letter][k], paper.SPEED[letter][k]
            failed = _failures(runs)
            lines.append(
                [letter, f"{speed:.2f}", *_compared(settled, whole, theirs, failed), str(failed)]
            )
    header = [
        "path",
        "m/s",
        "cross-track RMSE, mm",
        "with approach",
        "paper",
        "speed RMSE, mm/s",
        "with approach",
        "paper",
        "better",
        "failed",
    ]
    note = "Ours: simulated camera, IMU and fusion on the simulated fish, mean over seeds. Paper: the real robot."
    return Table("Errors", header, lines, note)


def better_cells(rows: Sequence[Row]) -> int:
    """Of the table's 16 cells, those in which no run failed and both errors are below the paper's."""
    return sum(line[-2] == "yes" for line in error_table(rows).rows)


def _compared(
    settled: ErrorSizes, whole: ErrorSizes, theirs: tuple[float, float], failed: int
) -> list[str]:
    ours = settled.cross_track_rmse, settled.speed_rmse
    better = not failed and ours[0] < theirs[0] and ours[1] < theirs[1]
    return [
        f"{1e3 * ours[0]:.1f}",
        f"{1e3 * whole.cross_track_rmse:.1f}",
        f"{1e3 * theirs[0]:.0f}",
        f"{1e3 * ours[1]:.1f}",
        f"{1e3 * whole.speed_rmse:.1f}",
        f"{1e3 * theirs[1]:.0f}",
        "yes" if better else "no",
    ]


def _failures(runs: Sequence[RunMetrics]) -> int:
    return sum(bool(m.failure) for m in runs)


def write_paper_page(path: Path, blocks: Sequence[Block]) -> None:
    """One self-contained page."""
    lead = "The figures and the table of the paper, made anew with this project's simulator, training and control."
    write_page(path, "The paper, remade", lead, blocks)
