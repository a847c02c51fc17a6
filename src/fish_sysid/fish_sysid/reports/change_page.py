# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of a comparison: sentence, what changed, OLD and NEW side by side with the model, tests, next experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fish_report.page import Figure, Table, Text, styled, write_page
from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.read import heading
from fish_sysid.diagnosis.change.change import Change
from fish_sysid.diagnosis.change.change_json import changed_robot
from fish_sysid.estimation.map_fit import initial_noise
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.prediction.kept_noise import kept_noise
from fish_sysid.prediction.prediction import predict
from fish_sysid.prediction.stroke_average import stroke_mean
from fish_sysid.reports.diagnosis_page import numbers, symmetry_table
from fish_sysid.reports.identify_page import MEASURED, SIMULATED

Array = np.ndarray[Any, np.dtype[np.float64]]
Content = dict[str, Any]

HORIZON = 2.0  # s, of the predictions that are drawn
SHOWN = 3  # trials of OLD and of NEW
UNCHANGED = "#8fbcbb"
NOTE = (
    "The first trials of each day. Grey: measured, averaged over strokes. "
    f"Lines: predicted {HORIZON:g} s ahead from estimated states, again and again, "
    "with the recorded commands, by OLD's model and by OLD's model with the change."
)


def write_change_page(path: Path, name: str, content: Content, change: Change) -> None:
    """Write report.html."""
    blocks: list[Text | Table | Figure] = []
    if change.named:
        blocks.append(_named(content))
    if change.robot is not None and change.old is not None and change.new is not None:
        blocks.append(side_by_side(change))
        blocks.append(_rarities(change))
        blocks.append(symmetry_table(content["symmetry"], "Symmetry tests of OLD"))
    blocks += [Text("Next experiment", content["next_experiment"]["why"])]
    blocks += [Text(heading(text), text) for text in content["left_out"]]
    blocks += [Text("Refused", text) for text in content["change"]["refused"]]
    blocks.append(Text("What remains", content["unexplained"]["description"]))
    write_page(path, f"What changed in {name}", content["sentence"], blocks)


def _named(content: Content) -> Table:
    rows = [
        [
            entry["name"] if i == 0 else "",
            member["name"],
            numbers(member["parameters"]),
            f"{member['probability']:.2f}",
            _p_value(member["remainder_p_value"]),
        ]
        for entry in content["effects"]
        for i, member in enumerate(entry["family"]["members"])
    ]
    note = (
        "Members of a family explain the change about equally well on trials of NEW that are left out in turn. p of the rest: of "
        "the swap test once this one is taken out; small where it leaves something; – of one that only the gyro's answer gives."
    )
    header = (
        "changed",
        "member of the family",
        "in NEW beside OLD",
        "probability",
        "p of the rest",
    )
    return Table("What changed", header, rows, note)


def _p_value(p: float) -> str:
    """Of the rest; nothing of a name that the gyro's answer alone gives."""
    return f"{p:.2g}" if np.isfinite(p) else "–"


def _rarities(change: Change) -> Table:
    best = sorted(change.rarities.items(), key=lambda item: -item[1])[:8]
    note = (
        "Of each name alone: how rare what it gains in NEW is among exchanged trials (swap test). The p-value of the change "
        "counts all names."
    )
    header = ("candidate", "p among exchanged trials, by itself")
    return Table("What differs most", header, [[n, f"{np.exp(-r):.2g}"] for n, r in best], note)


def side_by_side(change: Change) -> Figure:
    """Surge speed and yaw rate of some trials of OLD and NEW, measured and predicted."""
    # these images are at the moment they were taken
    changed = changed_robot(change).without_effect("camera_latency")
    days = [(day, e) for day, e in (("OLD", change.old), ("NEW", change.new)) if e is not None]
    shown = [(day, e.select([m])) for day, e in days for m in range(min(SHOWN, len(e.names)))]
    titles = [f"{day} {one.names[0]}" for day, one in shown]
    figure = make_subplots(
        2, len(shown), subplot_titles=titles, shared_yaxes=True, horizontal_spacing=0.02
    )
    first_of_new = 1 + next((i for i, (day, _) in enumerate(shown) if day == "NEW"), 0)
    for column, (day, one) in enumerate(shown, 1):
        t, mean = _measured(one)
        _line(figure, t, mean, "measured", MEASURED, column, column == 1)
        if change.robot is not None:
            curve = _predicted(one, change.robot)
            _line(figure, *curve, "OLD's model", UNCHANGED, column, column == 1)
        if day == "NEW" and change.named:
            curve = _predicted(one, changed)
            named = column == first_of_new
            _line(figure, *curve, "with the change", SIMULATED, column, named)
        figure.update_xaxes(title="time (s)", row=2, col=column)
    figure.update_yaxes(title="surge speed (m/s)", row=1, col=1)
    figure.update_yaxes(title="yaw rate (rad/s)", row=2, col=1)
    return Figure("OLD, NEW, and NEW with the change", styled(figure, 560, titled=True), NOTE)


def _measured(one: Experiment) -> tuple[Array, Array]:
    frames = one.frames[0]
    return frames.t, stroke_mean(frames.t, frames.t)(frames.pose)


def _predicted(one: Experiment, robot: Robot) -> tuple[Array, Array]:
    """Times and motion (F, 6) of the trial by one prediction of HORIZON after the other, each from an estimated state.

    With the noise of `robofish predict`: a filter that trusts a wrong model too much loses the fish.
    """
    noise = kept_noise(robot) or initial_noise(one, robot, usual_noise(one))
    run = predict(one, robot, noise, HORIZON, HORIZON)
    t, seen = one.frames[0].t, run.seen(0)
    motion = np.full((len(t), 6), np.nan)
    for s, start in enumerate(run.start * DT):
        own = (t >= start) & (t < start + HORIZON)
        known = np.isfinite(seen[:, s]).all(axis=1)
        if own.any() and known.sum() > 1:
            motion[own] = stroke_mean(t[known], t[own])(seen[known, s])
    return t, motion


def _line(
    figure: go.Figure, t: Array, motion: Array, label: str, colour: str, column: int, legend: bool
) -> None:
    shared = {
        "name": label,
        "legendgroup": label,
        "line": {"color": colour, "width": 1.5},
        "mode": "lines",
        "col": column,
    }
    figure.add_scatter(x=t, y=motion[:, 3], showlegend=legend, row=1, **shared)
    figure.add_scatter(x=t, y=motion[:, 5], showlegend=False, row=2, **shared)
