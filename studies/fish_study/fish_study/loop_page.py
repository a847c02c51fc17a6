# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How much of the way from the nominal model's gains to the plant's own each model's gains go: table and figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from scipy.stats import t as student

from fish_report.page import Table
from fish_train.evaluation.cells import Cell
from fish_train.evaluation.study import Row

Array = NDArray[np.float64]

TITLES = {"cross_track_rmse": "cross-track RMSE, mm", "speed_rmse": "speed RMSE, mm/s"}
FIRST, LAST = "nominal", "true"  # ends of the gap


def loop_table(rows: Sequence[Row]) -> Table:
    """Errors per model with the share of the gap that each closes; every training of every model has swum the same cells."""
    names = list(dict.fromkeys(row.candidate for row in rows))
    size = {key: {n: _sizes(rows, n, key) for n in names} for key in TITLES}
    header = [
        "gains from",
        *(text for title in TITLES.values() for text in (title, "of the gap")),
        "cross-track RMSE of each training, mm",
        "failed runs",
    ]
    text = []
    for n in names:
        own = [r for r in rows if r.candidate == n]
        cells = [n]
        for key in TITLES:
            cells += [f"{1e3 * size[key][n].mean():.1f}", _share(size[key], n)]
        each = ", ".join(f"{1e3 * mean:.1f}" for mean in size["cross_track_rmse"][n].mean(axis=1))
        text.append([*cells, each, f"{sum(bool(r.metrics.failure) for r in own)} of {len(own)}"])
    note = (
        "On the second plant, approach included, other seeds than the search's. Gap: from the nominal model's gains to those "
        "searched on the plant. In brackets the 95 % interval of its share, Fieller's for a ratio of means: Student's t over the "
        "trainings of each model, with one degree of freedom less than trainings, and over the runs, squares added. A model "
        "trained once counts as it is, and so does the one search on the plant."
    )
    return Table("Gains from a corrected model", header, text, note)


def speed_table(rows: Sequence[Row]) -> Table:
    """Cross-track errors and shares of the gap at each wanted speed: slow fish are at the water's mercy."""
    names = list(dict.fromkeys(row.candidate for row in rows))
    speeds = sorted({row.cell.speed for row in rows})
    header = ["gains from", *(text for v in speeds for text in (f"{v:g} m/s: mm", "of the gap"))]
    text = [[n] for n in names]
    for v in speeds:
        own = [row for row in rows if row.cell.speed == v]
        size = {n: _sizes(own, n, "cross_track_rmse") for n in names}
        for line, n in zip(text, names, strict=True):
            line += [f"{1e3 * size[n].mean():.1f}", _share(size, n)]
    return Table("Cross-track RMSE by wanted speed", header, text, "")


def loop_figure(rows: Sequence[Row]) -> go.Figure:
    """Cross-track error of every run, a box for each model."""
    figure = go.Figure()
    for name in dict.fromkeys(row.candidate for row in rows):
        own = [r for r in rows if r.candidate == name]
        what = [
            f"{r.cell.path}, {r.cell.speed} m/s, seed {r.cell.seed}<br>{r.metrics.failure}"
            for r in own
        ]
        figure.add_box(
            y=1e3 * _sizes(rows, name, "cross_track_rmse").ravel(),
            name=name,
            text=what,
            boxpoints="all",
            boxmean=True,
        )
    figure.update_layout(
        template="simple_white", showlegend=False, yaxis_title=TITLES["cross_track_rmse"]
    )
    return figure


def gap_share(nominal: Array, own: Array, true: Array) -> tuple[float, float, float]:
    """Of errors (T, R) of T trainings in the same R runs: (mean nominal - mean own) / (mean nominal - mean true), and the ends
    of its 95 % interval; infinite where the gap is not sure to be there. NaN where there is no gap, or for the ends of one run.

    Fieller's for a ratio of means: all shares s for which closed - s gap is within the half-width of its own 95 % interval. That
    has two parts: trainings of a model differ, and so do runs, which are common to the models. They have few and many degrees of
    freedom: each has the quantile of its own, and their squares are added, which is not too narrow (Banerjee 1960, Sankhya 22,
    357). Where there is one training, as of the plant's search, how another would differ is not known and not in it.
    """
    gap, closed = float(nominal.mean() - true.mean()), float(nominal.mean() - own.mean())
    if gap <= 0.0:
        return (float("nan"),) * 3
    runs = nominal.shape[1]
    if runs < 2:
        return closed / gap, float("nan"), float("nan")
    first, mine, last = (_of_trainings(errors) for errors in (nominal, own, true))
    both = [nominal.mean(axis=0) - errors.mean(axis=0) for errors in (own, true)]
    of_runs = _quantile(runs - 1) ** 2 * np.cov(both) / runs
    # (closed - s gap)^2 <= wide_closed - 2 s common + s^2 wide_gap
    wide_closed, wide_gap, common = (
        first + mine + of_runs[0, 0],
        first + last + of_runs[1, 1],
        first + of_runs[0, 1],
    )
    a, b, c = gap**2 - wide_gap, closed * gap - common, closed**2 - wide_closed
    if a <= 0.0:
        return closed / gap, -float("inf"), float("inf")
    half = float(np.sqrt(max(b**2 - a * c, 0.0)))
    return closed / gap, float((b - half) / a), float((b + half) / a)


def _of_trainings(errors: Array) -> float:
    """Square of the half-width of the 95 % interval of a mean of errors (T, R): of what trainings differ by in all runs alike."""
    count, runs = errors.shape
    if count < 2:
        return 0.0
    of_training, of_run = errors.mean(axis=1), errors.mean(axis=0)
    left = errors - of_training[:, None] - of_run + errors.mean()  # is in what runs differ by, too
    twice = float((left**2).sum()) / ((count - 1) * (runs - 1) * count * runs)
    alike = float(of_training.var(ddof=1)) / count - twice
    return float(_quantile(count - 1) ** 2 * max(alike, 0.0))


def _quantile(freedom: int) -> float:
    return float(student.isf(0.025, freedom))


def _share(sizes: Mapping[str, Array], name: str) -> str:
    if not all(np.isfinite(sizes[n]).all() for n in (FIRST, name, LAST)):
        return "unknown: a run diverged"
    share, low, high = gap_share(sizes[FIRST], sizes[name], sizes[LAST])
    if not np.isfinite(share):
        return "no gap"
    if name in (FIRST, LAST) or np.isnan(low):
        return f"{share:.0%}"
    return (
        f"{share:.0%} ({low:.0%} to {high:.0%})"
        if np.isfinite(low)
        else f"{share:.0%} (anything: no sure gap)"
    )


def _sizes(rows: Sequence[Row], name: str, key: str) -> Array:
    """(T, R) errors of a candidate's trainings in the same runs."""
    errors: dict[Cell, list[float]] = {row.cell: [] for row in rows}
    for row in rows:
        if row.candidate == name:
            errors[row.cell].append(getattr(row.metrics.whole, key))
    return np.array(list(errors.values())).T
