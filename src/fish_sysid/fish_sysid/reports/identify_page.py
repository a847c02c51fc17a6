# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of an identification: does the model swim as the fish did, and what is known about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots
from statsmodels.stats.diagnostic import acorr_ljungbox
from statsmodels.tsa.stattools import acf

from fish_report.page import (
    Block,
    Figure,
    Table,
    Text,
    styled,
    write_page,
)
from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.read import heading
from fish_sysid.estimation.ekf_types import ROWS
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.identification_result import Identification
from fish_sysid.prediction.prediction import WARM_UP, Predictions, predict
from fish_sysid.prediction.stroke_average import stroke_mean
from fish_sysid.reports.identify_tables import (
    bias_table,
    entangled_table,
    error_table,
    noise_table,
    parameter_table,
)

Array = NDArray[np.float64]

MEASURED, SIMULATED = "#4c566a", "#e07b39"
MOST_TRIALS = 6  # in the figures of motion
LAGS = 60  # of the autocorrelation, samples
LJUNG_BOX_LAG = 20
TITLES = dict(
    zip(
        ROWS,
        (
            "gyro",
            "accelerometer, forward",
            "accelerometer, left",
            "camera x",
            "camera y",
            "camera heading",
        ),
        strict=True,
    )
)


def write_identify_page(path: Path, result: Identification, left_out: Sequence[str] = ()) -> None:
    """Write the self-contained page."""
    blocks: list[Block] = [Text("", text) for text in result.statements]
    blocks += [Text(heading(text), text) for text in left_out]
    where = "trials left out of the fit" if result.held_out else "trials that took part in the fit"
    tables = [error_table(result.errors, f"Prediction error on {where}"), parameter_table(result)]
    tables += [entangled_table(result), bias_table(result), noise_table(result)]
    blocks += [t for t in tables[:1] if t.rows]
    blocks += motion_figures(result)
    blocks += [t for t in tables[1:] if _has_rows(t)]
    blocks.append(correlations(result))
    blocks += residual_figures(result)
    held = result.held_out.names if result.held_out else ()
    lead = f"Fitted to {', '.join(result.training.names)} in {result.seconds:.0f} s; left out: {', '.join(held) or 'none'}."
    write_page(path, f"Identification of {result.start.name}", lead, blocks)


def _has_rows(table: Table) -> bool:
    return bool(table.rows)


@dataclass(frozen=True)
class Swim:
    """One trial measured and simulated in one go from its start, as stroke means (F, 6): x, y, psi, u, v, r."""

    name: str
    t: Array  # (F,) s
    measured: Array
    simulated: Array


def swims(result: Identification) -> list[Swim]:
    """Held-out trials (or the training ones) simulated from their first estimate to their end without correction."""
    experiment = result.judged.estimates.experiment
    experiment = experiment.select(range(min(MOST_TRIALS, len(experiment.names))))
    return whole_swims(experiment, result.fit)


def whole_swims(experiment: Experiment, fit: Fit) -> list[Swim]:
    """Every trial simulated with a fitted robot from its first estimate to its end, without correction."""
    first = (
        0.0 if experiment.start_at_rest else min(WARM_UP, 0.25 * DT * int(experiment.steps.min()))
    )
    whole = DT * int(experiment.steps.max())
    run = predict(experiment, fit.robot, fit.noise, whole, whole, first)
    return [_swim(run, m) for m in range(len(experiment.names))]


def _swim(run: Predictions, m: int) -> Swim:
    experiment, frames = run.estimates.experiment, run.estimates.experiment.frames[m]
    seen = run.seen(m)[:, 0]
    known = np.isfinite(seen).all(1) & (frames.t >= run.start[run.trial == m][0] * DT)
    t, mean = frames.t[known], stroke_mean(frames.t[known], frames.t[known])
    return Swim(experiment.names[m], t, mean(frames.pose[known]), mean(seen[known]))


def motion_figures(result: Identification) -> list[Figure]:
    """Path, speed and yaw rate over time, and phase portrait."""
    found = swims(result)
    note = "Simulated in one go from the first estimate, without correction by measurements. Averaged over strokes."
    return [
        Figure(
            "Path, measured and simulated", _grid(found, (0,), (1,), ("x (m)", "y (m)"), True), note
        ),
        Figure(
            "Surge speed, measured and simulated",
            _grid(found, None, (3,), ("time (s)", "u (m/s)")),
            note,
        ),
        Figure(
            "Yaw rate, measured and simulated",
            _grid(found, None, (5,), ("time (s)", "r (rad/s)")),
            note,
        ),
        Figure(
            "Phase portrait: yaw rate over surge speed",
            _grid(found, (3,), (5,), ("u (m/s)", "r (rad/s)")),
            note,
        ),
    ]


def _grid(
    found: list[Swim],
    across: tuple[int] | None,
    up: tuple[int],
    titles: tuple[str, str],
    equal: bool = False,
) -> go.Figure:
    """One panel per trial; across None: time."""
    columns = min(3, len(found))
    rows = -(-len(found) // columns)
    figure = make_subplots(rows, columns, subplot_titles=[s.name for s in found])
    for i, swim in enumerate(found):
        place = {"row": i // columns + 1, "col": i % columns + 1}
        for values, name, colour in (
            (swim.measured, "measured", MEASURED),
            (swim.simulated, "simulated", SIMULATED),
        ):
            x = swim.t if across is None else values[:, across[0]]
            line = {"color": colour, "width": 1.5}
            figure.add_scatter(
                x=x,
                y=values[:, up[0]],
                name=name,
                mode="lines",
                line=line,
                legendgroup=name,
                showlegend=i == 0,
                **place,
            )
        figure.update_xaxes(title=titles[0], **place)
        figure.update_yaxes(title=titles[1], **place)
        if equal:
            anchor = "x" if i == 0 else f"x{i + 1}"
            figure.update_yaxes(scaleanchor=anchor, **place)
    figure = styled(figure, height=80 + 270 * rows)
    figure.update_layout(margin={"t": 60}, legend={"y": 1.08})
    return figure


def residual_figures(result: Identification) -> list[Figure]:
    """Whitened innovations of the training trials over time, and their autocorrelation."""
    white = result.fit.result.whitened
    present = [i for i in range(len(ROWS)) if np.isfinite(white[..., i]).any()]
    over_time = make_subplots(len(present), 1, shared_xaxes=True, vertical_spacing=0.02)
    for row, i in enumerate(present, start=1):
        for m, name in enumerate(result.training.names[:MOST_TRIALS]):
            k = np.flatnonzero(np.isfinite(white[:, m, i]))[::4]
            over_time.add_scatter(
                x=k * DT,
                y=white[k, m, i],
                mode="markers",
                marker={"size": 2},
                name=name,
                legendgroup=name,
                showlegend=row == 1,
                row=row,
                col=1,
            )
        over_time.update_yaxes(title=TITLES[ROWS[i]], row=row, col=1)
    over_time.update_xaxes(title="time (s)", row=len(present), col=1)
    return [
        Figure(
            "Residuals over time",
            styled(over_time, 150 * len(present) + 80),
            "Innovations over their standard deviation.",
        ),
        _autocorrelation(result, present),
    ]


def _autocorrelation(result: Identification, present: list[int]) -> Figure:
    """Mean over trials of each sensor's autocorrelation; Ljung-Box p values in the note."""
    figure, notes = go.Figure(), []
    for i in present:
        series = [w[np.isfinite(w)] for w in result.fit.result.whitened[..., i].T]
        series = [s for s in series if len(s) > 2 * LAGS]
        if not series:
            continue
        mean = np.mean([acf(s, nlags=LAGS, fft=True) for s in series], axis=0)
        figure.add_scatter(
            x=np.arange(1, LAGS + 1), y=mean[1:], name=TITLES[ROWS[i]], mode="lines+markers"
        )
        p = [float(acorr_ljungbox(s, lags=[LJUNG_BOX_LAG])["lb_pvalue"].iloc[0]) for s in series]
        notes.append(f"{TITLES[ROWS[i]]} {np.median(p):.2g}")
    figure.update_xaxes(title="lag (samples)")
    figure.update_yaxes(title="autocorrelation")
    note = f"White residuals stay near zero. Ljung-Box p over {LJUNG_BOX_LAG} lags, median of trials: {', '.join(notes)}."
    return Figure("Autocorrelation of the residuals", styled(figure), note)


def correlations(result: Identification) -> Figure:
    """Matrix of the correlations of the parameters' errors."""
    names = list(result.fit.hypothesis.free)
    heat = go.Heatmap(z=result.correlation, x=names, y=names, zmin=-1, zmax=1, colorscale="RdBu")
    return Figure("Correlation of the parameters' errors", styled(go.Figure(heat), 560))
