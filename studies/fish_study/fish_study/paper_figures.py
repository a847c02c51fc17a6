# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The paper's figures, remade."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from fish_control.policy_spec import OUTPUTS
from fish_control.reference_path import ReferencePath
from fish_report.page import styled
from fish_train.evaluation.follow import Trace
from fish_train.evaluation.open_loop import Swim
from fish_train.training.run_log import CurveRow

Array = NDArray[np.float64]
COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728")
REFERENCE = {"color": "#999999", "width": 2, "dash": "dash"}
GRID = 400  # points of a curve averaged over seeds


def portrait_figure(swim: Swim, last: float) -> go.Figure:
    """Yaw rate over surge speed while the fish gathers speed and in its limit cycle, and the path swum."""
    figure = make_subplots(cols=2, subplot_titles=("phase portrait", "path of the head"))
    late = swim.time >= swim.time[-1] - last
    for name, rows, colour in (
        ("from rest", ~late, "#bbbbbb"),
        (f"last {last:g} s", late, COLOURS[0]),
    ):
        line = {"color": colour, "width": 1.5}
        u, rate = swim.velocity[rows, 0], swim.velocity[rows, 2]
        figure.add_scatter(x=u, y=rate, name=name, line=line, mode="lines", row=1, col=1)
        x, y = swim.pose[rows, 0], swim.pose[rows, 1]
        figure.add_scatter(
            x=x, y=y, name=name, line=line, mode="lines", showlegend=False, row=1, col=2
        )
    figure.update_xaxes(title="surge speed, m/s", row=1, col=1)
    figure.update_yaxes(title="yaw rate, rad/s", row=1, col=1)
    figure.update_xaxes(title="x, m", row=1, col=2)
    figure.update_yaxes(title="y, m", scaleanchor="x2", row=1, col=2)
    return _with_titles(styled(figure, 380))


def throttle_figure(throttle: Array, speed: Array) -> go.Figure:
    """Steady speed against throttle."""
    figure = go.Figure(go.Scatter(x=throttle, y=speed, mode="lines+markers", name="steady speed"))
    figure.update_xaxes(title="throttle s")
    figure.update_yaxes(title="surge speed, m/s", rangemode="tozero")
    return styled(figure)


def training_figure(curves: Sequence[Sequence[CurveRow]]) -> go.Figure:
    """Mean and standard deviation over seeds of cross-track and speed error, against environment steps."""
    end = min(curve[-1].environment_steps for curve in curves)
    begin = max(curve[0].environment_steps for curve in curves)
    steps = np.linspace(begin, end, GRID)
    figure = make_subplots(
        cols=2, subplot_titles=("mean |cross-track|, mm", "mean |speed error|, mm/s")
    )
    for col, field in enumerate(("cross_track", "speed"), start=1):
        values = 1e3 * np.array(
            [
                np.interp(
                    steps,
                    [r.environment_steps for r in curve],
                    _smooth([getattr(r, field) for r in curve]),
                )
                for curve in curves
            ]
        )
        mean, std = values.mean(axis=0), values.std(axis=0)
        band = np.r_[mean + std, (mean - std)[::-1]]
        figure.add_scatter(
            x=np.r_[steps, steps[::-1]],
            y=band,
            fill="toself",
            line={"width": 0},
            fillcolor="rgba(31,119,180,0.2)",
            name="± 1 std",
            hoverinfo="skip",
            showlegend=col == 1,
            row=1,
            col=col,
        )
        figure.add_scatter(
            x=steps,
            y=mean,
            mode="lines",
            line={"color": COLOURS[0]},
            name="mean",
            showlegend=col == 1,
            row=1,
            col=col,
        )
        figure.update_xaxes(title="environment steps", row=1, col=col)
    return _with_titles(styled(figure, 340))


def path_figure(path: ReferencePath, traces: Sequence[tuple[str, Array]]) -> go.Figure:
    """Paths swum over the reference; traces are (name, (T, 2) positions)."""
    figure = go.Figure()
    closing = [0] if path.closed else []
    points = np.vstack([path.points, path.points[closing]])
    figure.add_scatter(
        x=points[:, 0], y=points[:, 1], mode="lines", name="reference", line=REFERENCE
    )
    for (name, position), colour in zip(traces, COLOURS, strict=False):
        line = {"color": colour, "width": 1.5}
        figure.add_scatter(x=position[:, 0], y=position[:, 1], mode="lines", name=name, line=line)
    figure.update_xaxes(title="x, m")
    figure.update_yaxes(title="y, m", scaleanchor="x")
    return styled(figure, 420)


def gains_figure(trace: Trace, run: int) -> go.Figure:
    """The six gains of one run over time, steering left and speed right."""
    figure = make_subplots(cols=2, subplot_titles=("steering", "speed"))
    swum = np.isfinite(trace.cross_track[:, run])
    for k, output in enumerate(OUTPUTS):
        figure.add_scatter(
            x=trace.time[swum],
            y=trace.gains[swum, run, k],
            mode="lines",
            name=output.name,
            line={"color": COLOURS[k % 3]},
            row=1,
            col=1 + k // 3,
        )
    figure.update_xaxes(title="time, s")
    return _with_titles(styled(figure, 320))


def _smooth(values: Sequence[float], width: int = 9) -> Array:
    """Running mean, shorter at the ends and over a curve that is shorter itself."""
    v = np.asarray(values, dtype=float)
    ones = np.ones(min(width, len(v)))
    return np.convolve(v, ones, "same") / np.convolve(np.ones(len(v)), ones, "same")


def _with_titles(figure: go.Figure) -> go.Figure:
    """Room for the titles of subplots above the legend."""
    figure.update_layout(margin={"t": 60}, legend={"y": 1.12})
    return figure
