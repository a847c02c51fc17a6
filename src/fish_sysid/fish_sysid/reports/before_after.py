# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Held-out trials, measured and simulated without correction: the refitted nominal model and the one with the effects found."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fish_report.page import Figure, styled
from fish_sysid.diagnosis.result import Diagnosis
from fish_sysid.reports.identify_page_figures import (
    MEASURED,
    SIMULATED,
    Swim,
    whole_swims,
)

MOST_TRIALS = 4
REFITTED = "#8fbcbb"
NOTE = (
    "Simulated from the first estimate to the trial's end with the recorded inputs, without correction by measurements. "
    "Averaged over strokes. Grey: measured."
)


def before_after(d: Diagnosis) -> Figure:
    """Paths (upper row) and surge speeds (lower row) of up to MOST_TRIALS trials, held-out ones if there are any."""
    which = (d.task.split.held_out or d.task.split.training)[:MOST_TRIALS]
    experiment = d.task.experiment.select(which)
    shown = {"refitted": (d.nominal, REFITTED)}
    if d.accepted:
        shown["with effects"] = (d.final, SIMULATED)
    figure = make_subplots(2, len(which), subplot_titles=experiment.names, horizontal_spacing=0.05)
    for label, (fit, colour) in shown.items():
        for m, swim in enumerate(whole_swims(experiment, fit)):
            if label == "refitted":
                _lines(figure, swim, measured=True, label="measured", colour=MEASURED, column=m + 1)
            _lines(figure, swim, measured=False, label=label, colour=colour, column=m + 1)
    for m in range(len(which)):
        figure.update_yaxes(scaleanchor="x" if m == 0 else f"x{m + 1}", row=1, col=m + 1)
        figure.update_xaxes(title="x (m)", row=1, col=m + 1)
        figure.update_xaxes(title="time (s)", row=2, col=m + 1)
    figure.update_yaxes(title="y (m)", row=1, col=1)
    figure.update_yaxes(title="surge speed (m/s)", row=2, col=1)
    title = f"Measured and simulated, before and after: {d.unseen_are}"
    return Figure(title, styled(figure, 660, titled=True), NOTE)


def _lines(
    figure: go.Figure, swim: Swim, measured: bool, label: str, colour: str, column: int
) -> None:
    """Path and speed of one trial in its column."""
    values, line = (swim.measured if measured else swim.simulated), {"color": colour, "width": 1.5}
    shared = {"name": label, "legendgroup": label, "line": line, "mode": "lines", "col": column}
    figure.add_scatter(x=values[:, 0], y=values[:, 1], showlegend=column == 1, row=1, **shared)
    figure.add_scatter(x=swim.t, y=values[:, 3], showlegend=False, row=2, **shared)
