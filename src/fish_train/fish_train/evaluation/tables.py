# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a study found: tables for terminal and page, and the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fish_report.page import Block, Table, write_page
from fish_train.evaluation.cells import LAPS
from fish_train.evaluation.follow import ErrorSizes
from fish_train.evaluation.study import Row, mean_sizes

SUMMARY_COLUMNS = (
    ("cross-track RMSE", "cross_track_rmse", 1e3, "mm"),
    ("mean", "cross_track_mean", 1e3, "mm"),
    ("95 %", "cross_track_p95", 1e3, "mm"),
    ("heading RMSE", "heading_rmse", 1e3, "mrad"),
    ("speed RMSE", "speed_rmse", 1e3, "mm/s"),
    ("rudder rate", "rudder_rate_rms", 1.0, "rad/s"),
    ("throttle", "throttle_mean", 1.0, ""),
)
APPROACH_COLUMNS = (
    ("cross-track RMSE *", "cross_track_rmse", 1e3, "mm"),
    ("speed RMSE *", "speed_rmse", 1e3, "mm/s"),
)


def unique(rows: Sequence[Row], key: Callable[[Row], object]) -> list[Any]:
    """Distinct values in order of appearance."""
    return list(dict.fromkeys(map(key, rows)))


def summary_table(rows: Sequence[Row], title: str) -> Table:
    """One line for each candidate under each condition, means over its runs."""
    header = ["gains", "condition", "runs", "failed"]
    header += [
        f"{name}, {unit}" if unit else name
        for name, _, _, unit in (*SUMMARY_COLUMNS, *APPROACH_COLUMNS)
    ]
    lines = []
    for candidate in unique(rows, lambda r: r.candidate):
        for condition in unique(rows, lambda r: r.condition):
            runs = [r for r in rows if (r.candidate, r.condition) == (candidate, condition)]
            if runs:
                lines.append(
                    [candidate, condition, str(len(runs)), str(_failures(runs)), *_summary(runs)]
                )
    note = (
        "Means over the runs that did not fail, after the approach; * approach included. "
        "Speed: ripple of each stroke included."
    )
    return Table(title, header, lines, note)


def cell_table(rows: Sequence[Row], title: str) -> Table:
    """Cross-track and speed RMSE of every path and speed, averaged over seeds, for one candidate and condition."""
    speeds = sorted({r.cell.speed for r in rows})
    header = ["path", *(f"{v:g} m/s" for v in speeds)]
    lines = []
    for path in unique(rows, lambda r: r.cell.path):
        cells = [[r for r in rows if r.cell.path == path and r.cell.speed == v] for v in speeds]
        lines.append([path, *(_cell(runs) for runs in cells)])
    note = "Cross-track RMSE [mm] / speed RMSE [mm/s] after the approach, means over the runs that did not fail."
    return Table(title, header, lines, note)


def ratio_table(rows: Sequence[Row], nominal: str, title: str) -> Table:
    """How much worse each condition makes the worst and the mean cell of a candidate, against its nominal condition."""
    lines = []
    for candidate in unique(rows, lambda r: r.candidate):
        for condition in unique(rows, lambda r: r.condition):
            if condition == nominal:
                continue
            ratios = cell_ratios(rows, candidate, condition, nominal)
            failed = _failures(
                [r for r in rows if (r.candidate, r.condition) == (candidate, condition)]
            )
            sizes = [
                _mean_and_worst({cell: pair[k] for cell, pair in ratios.items()}) for k in range(2)
            ]
            lost = len(lost_cells(rows, candidate, condition, nominal))
            over = lost + sum(max(pair) > 2.0 for pair in ratios.values())
            lines.append(
                [candidate, condition, str(failed), *sizes, f"{over} of {lost + len(ratios)}"]
            )
    header = [
        "gains",
        "condition",
        "failed",
        "cross-track: mean, worst",
        "speed: mean, worst",
        "cells above twice",
    ]
    note = (
        f"RMSE of each path and speed, mean of its runs that did not fail, against the same under: {nominal}. A cell whose "
        f"runs all failed counts as above twice; one whose runs all failed under {nominal} is left out."
    )
    return Table(title, header, lines, note)


def cell_ratios(
    rows: Sequence[Row], candidate: str, condition: str, nominal: str
) -> dict[tuple[str, float], tuple[float, float]]:
    """Ratios of cross-track and of speed RMSE by path and speed, means over the runs that did not fail."""
    worse, base = (_cell_means(rows, candidate, name) for name in (condition, nominal))
    return {
        k: (
            worse[k].cross_track_rmse / base[k].cross_track_rmse,
            worse[k].speed_rmse / base[k].speed_rmse,
        )
        for k in worse
        if k in base
    }


def lost_cells(
    rows: Sequence[Row], candidate: str, condition: str, nominal: str
) -> list[tuple[str, float]]:
    """Paths and speeds at which every run failed, and under the nominal condition not every one."""
    base, worse = (_cell_means(rows, candidate, name) for name in (nominal, condition))
    mine = [r for r in rows if (r.candidate, r.condition) == (candidate, condition)]
    return [k for k in unique(mine, _path_and_speed) if k in base and k not in worse]


def _cell_means(
    rows: Sequence[Row], candidate: str, condition: str
) -> dict[tuple[str, float], ErrorSizes]:
    """Of each path and speed, over the runs that did not fail; without those of which none is left."""
    mine = [
        r
        for r in rows
        if (r.candidate, r.condition) == (candidate, condition) and not r.metrics.failure
    ]
    keys = unique(mine, _path_and_speed)
    return {
        k: mean_sizes([r.metrics.settled for r in mine if _path_and_speed(r) == k]) for k in keys
    }


def _path_and_speed(row: Row) -> tuple[str, float]:
    return row.cell.path, row.cell.speed


def _mean_and_worst(ratios: dict[tuple[str, float], float]) -> str:
    if not ratios:
        return ""
    path, speed = max(ratios, key=lambda cell: ratios[cell])
    return f"{np.mean(list(ratios.values())):.2f}, {ratios[path, speed]:.2f} ({path} {speed:g} m/s)"


def _failures(runs: Sequence[Row]) -> int:
    return sum(bool(r.metrics.failure) for r in runs)


def _summary(runs: Sequence[Row]) -> list[str]:
    good = [r.metrics for r in runs if not r.metrics.failure]
    if not good:
        return [""] * (len(SUMMARY_COLUMNS) + len(APPROACH_COLUMNS))
    settled, whole = mean_sizes([m.settled for m in good]), mean_sizes([m.whole for m in good])
    return [
        *(f"{scale * getattr(settled, field):.3g}" for _, field, scale, _ in SUMMARY_COLUMNS),
        *(f"{scale * getattr(whole, field):.3g}" for _, field, scale, _ in APPROACH_COLUMNS),
    ]


def _cell(runs: Sequence[Row]) -> str:
    good = [r.metrics.settled for r in runs if not r.metrics.failure]
    if not good:
        return "failed" if runs else ""
    sizes, failed = mean_sizes(good), len(runs) - len(good)
    said = f" ({failed} of {len(runs)} failed)" if failed else ""
    return f"{1e3 * sizes.cross_track_rmse:.1f} / {1e3 * sizes.speed_rmse:.1f}{said}"


def write_study_page(path: Path, rows: Sequence[Row], nominal: str | None = None) -> None:
    """Tables of a study; nominal: the condition that the others are compared with, None: the first."""
    conditions = unique(rows, lambda r: r.condition)
    blocks: list[Block] = [summary_table(rows, "Tracking")]
    if len(conditions) > 1:
        blocks.append(ratio_table(rows, nominal or conditions[0], "Robustness"))
    for candidate in unique(rows, lambda r: r.candidate):
        for condition in conditions:
            mine = [r for r in rows if (r.candidate, r.condition) == (candidate, condition)]
            blocks.append(cell_table(mine, f"{candidate}: {condition}"))
    lead = f"{len(rows)} simulated runs from rest: an open path to its end, a closed one for the time of {LAPS:g} laps."
    write_page(path, "Evaluation", lead, blocks)
