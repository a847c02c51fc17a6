# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figures of a diagnosis: the missing force, the water and the times of what was found, before and after, the next experiment."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.figure_factory import create_quiver
from plotly.subplots import make_subplots
from scipy.stats import binned_statistic

from fish_control.excitation import LAST_ROW
from fish_node.pool import LENGTH, WIDTH
from fish_report.page import Figure, styled
from fish_sim.effects import EFFECTS
from fish_sim.effects.effect import Effect, Flow
from fish_sim.model import DT
from fish_sysid.diagnosis.effect_wrench import ACTIVE
from fish_sysid.diagnosis.latent_force import DOFS, MissingForce
from fish_sysid.diagnosis.result import Diagnosis
from fish_sysid.estimation.parametrization import EffectTable
from fish_sysid.reports.identify_page import (
    MEASURED,
    SIMULATED,
    Swim,
    whole_swims,
)

Content = dict[str, Any]
Array = NDArray[np.float64]

COLOURS = {"surge": "#5b6bd6", "sway": "#1fa774", "yaw": "#e07b39"}
SHOWN = 4000  # points of a scatter
BINS = 15  # of a covariate, about equally full
# share of the time: an effect that acts for longer may be said to act all the time
NOT_ALWAYS = 0.75
MISTAKEN = 1 / 3  # of what F1 lacks where an effect is said to act all the time
MOST_TRIALS = 4
REFITTED = "#8fbcbb"
NOTE = (
    "Simulated from the first estimate to the trial's end with the recorded inputs, without correction by measurements. "
    "Averaged over strokes. Grey: measured."
)


def force_over_the_pool(d: Diagnosis) -> go.Figure:
    """Size of the force that the nominal model lacks, in standard deviations of the water's, where the fish was."""
    c, scale = d.force.covariates, np.array(d.final.noise.wrench)
    e = np.sqrt(np.sum((d.force.wrench / scale) ** 2, axis=2)).ravel()
    x, y = c["x"].ravel(), c["y"].ravel()
    keep = np.flatnonzero(np.isfinite(e))
    keep = keep[:: max(1, len(keep) // SHOWN)]
    marker = {
        "size": 4,
        "color": np.minimum(e[keep], np.nanquantile(e, 0.98)),
        "colorscale": "Viridis_r",
        "showscale": True,
    }
    figure = go.Figure(go.Scatter(x=x[keep], y=y[keep], mode="markers", marker=marker))
    return _in_pool(figure)


def _in_pool(figure: go.Figure) -> go.Figure:
    """Walls, and metres of the same length on both axes."""
    figure.add_shape(type="rect", x0=-LENGTH / 2, x1=LENGTH / 2, y0=-WIDTH / 2, y1=WIDTH / 2)
    figure.update_yaxes(scaleanchor="x", title="y, m")
    figure.update_xaxes(title="x, m")
    return styled(figure, 420)


def force_over_time(d: Diagnosis) -> go.Figure:
    """That force in the first training trial, and what remains of it in the final model."""
    figure = go.Figure()
    t = DT * np.arange(len(d.force.wrench))
    for i, dof in enumerate(DOFS):
        unit = "N m" if dof == "yaw" else "N"
        figure.add_scatter(
            x=t,
            y=d.force.wrench[:, 0, i],
            name=f"{dof}, {unit}",
            line={"color": COLOURS[dof]},
            visible=True if i < 2 else "legendonly",
        )
        figure.add_scatter(
            x=t,
            y=d.remaining.wrench[:, 0, i],
            name=f"{dof} remaining",
            line={"color": "#999"},
            visible=True if i == 0 else "legendonly",
        )
    figure.update_xaxes(title="t, s")
    return styled(figure)


def force_against_covariates(d: Diagnosis) -> go.Figure:
    """Means of that force over bins of each covariate."""
    names = ("surge_speed", "rudder", "yaw_rate", "wall_distance")
    figure = make_subplots(rows=1, cols=len(names), subplot_titles=names)
    for column, name in enumerate(names, 1):
        for i, dof in enumerate(DOFS):
            middle, mean = binned_means(
                d.force.covariates[name].ravel(), d.force.wrench[..., i].ravel()
            )
            figure.add_scatter(
                x=middle,
                y=mean / d.final.noise.wrench[i],
                name=dof,
                legendgroup=dof,
                line={"color": COLOURS[dof]},
                showlegend=column == 1,
                row=1,
                col=column,
            )
    figure.update_yaxes(title="mean missing wrench / water noise", col=1)
    return styled(figure, 360, titled=True)


def binned_means(v: Array, w: Array) -> tuple[Array, Array]:
    """(middles, means of w) over up to BINS bins of v that hold about as many samples each; empty where v never changes."""
    good = np.isfinite(v) & np.isfinite(w)
    # a rudder at its stop has one value many times over, an edge of several bins, of which all but one would be empty
    edges = (
        np.unique(np.quantile(v[good], np.linspace(0, 1, BINS + 1))) if good.any() else np.zeros(0)
    )
    if len(edges) < 2:
        return np.zeros(0), np.zeros(0)
    mean, edges, _ = binned_statistic(v[good], w[good], "mean", edges)
    return 0.5 * (edges[1:] + edges[:-1]), mean


def moves_water(name: str, effects: EffectTable = EFFECTS) -> bool:
    """Whether an effect lets the water flow, the same at all times."""
    effect = effects.get(name)
    return effect is not None and effect.water is not Effect.water and not effect.states


def water_over_the_pool(effect: Content, d: Diagnosis, effects: EffectTable = EFFECTS) -> Figure:
    """Arrows of the water's velocity on a grid over the pool, and where the fish was."""
    values = SimpleNamespace(**{k: p["value"] for k, p in effect["parameters"].items()})
    x, y = np.meshgrid(
        np.linspace(-0.47 * LENGTH, 0.47 * LENGTH, 25), np.linspace(-0.45 * WIDTH, 0.45 * WIDTH, 12)
    )
    velocity, _ = cast(Flow, effects[effect["name"]].water(values, x, y, SimpleNamespace(), np))
    u, v = (np.broadcast_to(component, x.shape) for component in velocity)
    fastest = float(np.hypot(u, v).max())
    step = x[0, 1] - x[0, 0]
    figure = create_quiver(
        x,
        y,
        u,
        v,
        scale=0.9 * step / max(fastest, 1e-12),
        line={"color": COLOURS["surge"]},
        name="water",
    )
    swum = np.stack([d.force.covariates[k].T.ravel() for k in "xy"])[:, ::10]
    figure.add_scatter(
        x=swum[0], y=swum[1], mode="markers", marker={"size": 3, "color": "#b8c3cd"}, name="fish"
    )
    note = f"longest arrow: {fastest:.3g} m/s; where the fish never was (no grey) the arrows only continue what it met"
    return Figure(f"The water with {effect['name']}", _in_pool(figure), note)


def tells_when(where: Content, push: MissingForce) -> bool:
    """Whether an effect acts part of the time, and the most telling range of a covariate really tells when; push: its force.

    To say that it acts all the time has an F1 of 2 p / (1 + p), p the share of time in which it acts. A drag acts everywhere,
    above the threshold of `acting` now and then, and a range of any covariate that holds most of the samples reaches about as
    much. A range tells if it leaves less than MISTAKEN of what that F1 lacks.
    """
    seconds = DT * float(np.isfinite(push.wrench[..., 0]).sum())
    p = sum(row["to"] - row["from"] for row in where["time"]) / seconds
    always = 2.0 * p / (1.0 + p)
    best = max((row["f1"] for row in where["covariates"]), default=0.0)
    return bool(p < NOT_ALWAYS and 1.0 - best < MISTAKEN * (1.0 - always))


def when_it_acts(effect: Content) -> Figure:
    """The intervals in which an effect acts, a row per trial."""
    figure, times = go.Figure(), sorted(effect["where"]["time"], key=lambda row: row["trial"])
    figure.add_bar(
        y=[row["trial"] for row in times],
        base=[row["from"] for row in times],
        x=[row["to"] - row["from"] for row in times],
        orientation="h",
        marker={"color": COLOURS["surge"]},
        hovertext=[f"{row['share']:.0%} of its push" for row in times],
    )
    figure.update_xaxes(title="t, s")
    tells = effect["where"]["covariates"][0]
    low, high = tells["range"]
    note = (
        f"intervals in which its own force in the final model is above {ACTIVE:.0%} of what it is at its strongest; "
        f"{tells['name']} from {low:.3g} to {high:.3g} tells them best (F1 {tells['f1']:.2f})"
    )
    return Figure(
        f"When {effect['name']} acts",
        styled(figure, 120 + 26 * len({r["trial"] for r in times})),
        note,
    )


def program(content: Content) -> go.Figure:
    """Stroke and rudder of the next experiment over time."""
    rows = content["next_experiment"]["program"]
    figure = go.Figure()
    t = [r["t"] for r in rows] + [rows[-1]["t"] + LAST_ROW]
    for key in ("amplitude", "frequency", "rudder"):
        values = [r[key] for r in rows]
        figure.add_scatter(x=t, y=[*values, values[-1]], name=key, line={"shape": "hv"})
    figure.update_xaxes(title="t, s")
    return styled(figure)


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
