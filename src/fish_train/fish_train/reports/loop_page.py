"""How much of the way from the nominal model's gains to the plant's own each model's gains go: table and figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from fish_train.evaluation.study import Row
from fish_train.reports.page import Table

Array = NDArray[np.float64]

TITLES = {"cross_track_rmse": "cross-track RMSE, mm", "speed_rmse": "speed RMSE, mm/s"}
FIRST, LAST = "nominal", "true"  # ends of the gap
RESAMPLED = 10000


def loop_table(rows: Sequence[Row]) -> Table:
    """Errors per model with the share of the gap that each closes; every model has swum the same cells in the same order."""
    names = list(dict.fromkeys(row.candidate for row in rows))
    size = {key: {n: _sizes(rows, n, key) for n in names} for key in TITLES}
    header = [
        "gains from",
        *(text for title in TITLES.values() for text in (title, "of the gap")),
        "failed runs",
    ]
    text = []
    for n in names:
        own = [r for r in rows if r.candidate == n]
        cells = [n]
        for key in TITLES:
            cells += [
                f"{1e3 * size[key][n].mean():.1f}",
                _share(size[key][FIRST], size[key][n], size[key][LAST]),
            ]
        text.append([*cells, f"{sum(bool(r.metrics.failure) for r in own)} of {len(own)}"])
    note = (
        "On the second plant, approach included, other seeds than the search's. Gap: from the nominal model's gains to those "
        "searched on the plant; in brackets the 95 % interval by resampling runs."
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
            line += [f"{1e3 * size[n].mean():.1f}", _share(size[FIRST], size[n], size[LAST])]
    return Table("Cross-track RMSE by wanted speed", header, text, "")


def loop_figure(rows: Sequence[Row]) -> go.Figure:
    """Cross-track error of every run, a box for each model."""
    figure = go.Figure()
    for name in dict.fromkeys(row.candidate for row in rows):
        own = [r for r in rows if r.candidate == name]
        what = [f"{r.cell.path}, {r.cell.speed} m/s, seed {r.cell.seed}<br>{r.metrics.failure}" for r in own]
        figure.add_box(
            y=1e3 * _sizes(rows, name, "cross_track_rmse"),
            name=name,
            text=what,
            boxpoints="all",
            boxmean=True,
        )
    figure.update_layout(template="simple_white", showlegend=False, yaxis_title=TITLES["cross_track_rmse"])
    return figure


def gap_share(nominal: Array, own: Array, true: Array) -> tuple[float, float, float]:
    """Of errors of the same runs (R,): (mean nominal - mean own) / (mean nominal - mean true), ends of its 95 % interval.

    Runs are resampled, the same for all three, which stir the same water. NaN where there is no gap to close.
    """
    drawn = np.random.default_rng(0).integers(len(own), size=(RESAMPLED, len(own)))
    gap, closed = nominal - true, nominal - own
    if gap.mean() <= 0.0:
        return (float("nan"),) * 3
    gaps, shares = gap[drawn].mean(axis=1), closed[drawn].mean(axis=1)
    # a resampled gap near zero or below says that the share is not known at all: it counts as an end of the line
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(gaps > 0.0, shares / gaps, np.where(shares > 0.0, np.inf, -np.inf))
    low, high = np.quantile(ratio, [0.025, 0.975], method="nearest")
    return float(closed.mean() / gap.mean()), float(low), float(high)


def _share(nominal: Array, own: Array, true: Array) -> str:
    share, low, high = gap_share(nominal, own, true)
    if not np.isfinite(share):
        return "no gap"
    return f"{share:.0%}" if low == high else f"{share:.0%} ({low:.0%} to {high:.0%})"


def _sizes(rows: Sequence[Row], name: str, key: str) -> Array:
    """(R,) errors of a candidate's runs."""
    return np.array([getattr(r.metrics.whole, key) for r in rows if r.candidate == name])
