"""How much of the way from the nominal model's gains to the plant's own each model's gains go: table and figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from fish_train.evaluation.cells import Cell
from fish_train.evaluation.study import Row
from fish_train.reports.page import Table

Array = NDArray[np.float64]

TITLES = {"cross_track_rmse": "cross-track RMSE, mm", "speed_rmse": "speed RMSE, mm/s"}
FIRST, LAST = "nominal", "true"  # ends of the gap
RESAMPLED = 10000


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
        "searched on the plant; in brackets the 95 % interval by resampling trainings and runs."
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
        what = [f"{r.cell.path}, {r.cell.speed} m/s, seed {r.cell.seed}<br>{r.metrics.failure}" for r in own]
        figure.add_box(
            y=1e3 * _sizes(rows, name, "cross_track_rmse").ravel(),
            name=name,
            text=what,
            boxpoints="all",
            boxmean=True,
        )
    figure.update_layout(template="simple_white", showlegend=False, yaxis_title=TITLES["cross_track_rmse"])
    return figure


def gap_share(nominal: Array, own: Array, true: Array) -> tuple[float, float, float]:
    """Of errors (T, R) of T trainings in the same R runs: (mean nominal - mean own) / (mean nominal - mean true), and the ends
    of its 95 % interval.

    Runs are resampled, the same for all three, which stir the same water, and the trainings of each. NaN where there is no
    gap to close.
    """
    random = np.random.default_rng(0)
    gap = nominal.mean() - true.mean()
    if gap <= 0.0:
        return (float("nan"),) * 3
    runs = random.integers(nominal.shape[1], size=(RESAMPLED, nominal.shape[1]))
    first, mine, last = (_resampled(errors, runs, random) for errors in (nominal, own, true))
    gaps, closed = first - last, first - mine
    # a resampled gap near zero or below says that the share is not known at all: it counts as an end of the line
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(gaps > 0.0, closed / gaps, np.where(closed > 0.0, np.inf, -np.inf))
    low, high = np.quantile(ratio, [0.025, 0.975], method="nearest")
    return float((nominal.mean() - own.mean()) / gap), float(low), float(high)


def _resampled(errors: Array, runs: NDArray[np.int64], random: np.random.Generator) -> Array:
    """(N,) means of errors (T, R) over the runs (N, R) and as many trainings, drawn anew each time."""
    trainings = random.integers(len(errors), size=(len(runs), len(errors)))
    of_training = errors[:, runs].mean(axis=2).T  # (N, T)
    mean: Array = np.take_along_axis(of_training, trainings, axis=1).mean(axis=1)
    return mean


def _share(sizes: Mapping[str, Array], name: str) -> str:
    if not all(np.isfinite(sizes[n]).all() for n in (FIRST, name, LAST)):
        return "unknown: a run diverged"
    share, low, high = gap_share(sizes[FIRST], sizes[name], sizes[LAST])
    if not np.isfinite(share):
        return "no gap"
    known = name in (FIRST, LAST) or low == high
    return f"{share:.0%}" if known else f"{share:.0%} ({low:.0%} to {high:.0%})"


def _sizes(rows: Sequence[Row], name: str, key: str) -> Array:
    """(T, R) errors of a candidate's trainings in the same runs."""
    errors: dict[Cell, list[float]] = {row.cell: [] for row in rows}
    for row in rows:
        if row.candidate == name:
            errors[row.cell].append(getattr(row.metrics.whole, key))
    return np.array(list(errors.values())).T
