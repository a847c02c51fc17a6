# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables and page of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fish_bag.trial import Commands, Gains, Trial
from fish_bringup.node_table import NAMESPACE, NodeSpec
from fish_bringup.run_watch import SwimEnd
from fish_bringup.score import RunScore
from fish_control.path_tracker import stroke_mean
from fish_control.pool import HALF_LENGTH, HALF_WIDTH
from fish_report.page import (
    Block,
    Figure,
    Table,
    styled,
    write_page,
)
from fish_report.printable import plain

BLUE, ORANGE, GREY, GREEN = "#1f6fb2", "#e07b39", "#9aa7b2", "#3a9a5b"
SOURCES = {
    "truth": "the simulator's true pose",
    "estimate": "the robot's own estimate (odometry/filtered)",
}
GAIN_NAMES = ("steering Kp", "steering Ki", "steering Kd", "speed Kp", "speed Ki", "speed Kd")


def write_run_page(
    path: Path, title: str, trial: Trial, score: RunScore, tables: list[Table]
) -> None:
    """Write report.html: path, errors, speed, gains and commands of a recorded run, and the tables given."""
    trial = trial.clean()
    blocks: list[Block] = [Figure("Path in the pool", _pool(score), _pool_note(score))]
    blocks += tables[:1]
    blocks += [Figure("Errors", _errors(score)), Figure("Surge speed", _speed(score))]
    if trial.gains is not None:
        blocks.append(Figure("Gains", _gains(trial.gains), "As published by the controller."))
    if trial.commands is not None:
        blocks.append(
            Figure(
                "Commands", _commands(trial.commands), "Rotor speed and rudder angle as commanded."
            )
        )
    write_page(path, title, _lead(score), [*blocks, *tables[1:]])


def _lead(score: RunScore) -> str:
    distance = score.progress[-1] - score.progress[0]
    end = "reached the end of the path" if score.finished else "did not end on the path's end"
    slowest, fastest = (
        f"{speed:.2f}" for speed in (score.reference_speed.min(), score.reference_speed.max())
    )
    wanted = slowest if slowest == fastest else f"{slowest} to {fastest}"
    return (
        f"{score.t[-1] - score.t[0]:.1f} s at {wanted} m/s, {distance:.2f} m of the path; "
        f"the fish {end}. Scored against {SOURCES[score.source]}."
    )


def _pool_note(score: RunScore) -> str:
    if np.isnan(score.approach_s):
        return "The approach phase never ended: the fish did not come near path and speed."
    return f"The approach phase took {score.approach_s:.1f} s."


def _pool(score: RunScore) -> go.Figure:
    """Top view: walls, reference, swum path with the approach phase apart."""
    reference = (
        score.path.points
        if not score.path.closed
        else np.vstack([score.path.points, score.path.points[:1]])
    )
    figure = go.Figure()
    figure.add_shape(
        type="rect",
        x0=-HALF_LENGTH,
        x1=HALF_LENGTH,
        y0=-HALF_WIDTH,
        y1=HALF_WIDTH,
        line={"color": GREY, "width": 2},
        fillcolor="#eef5fa",
        layer="below",
    )
    figure.add_scatter(
        x=reference[:, 0],
        y=reference[:, 1],
        name="reference",
        line={"color": ORANGE, "width": 6},
        opacity=0.5,
    )
    for name, part, colour in (
        ("approach", slice(0, score.settled + 1), GREY),
        ("swum", slice(score.settled, None), BLUE),
    ):
        x, y = score.position[part].T
        figure.add_scatter(x=x, y=y, name=name, line={"color": colour, "width": 2}, mode="lines")
    start = score.position[0]
    figure.add_scatter(
        x=start[:1], y=start[1:], name="start", mode="markers", marker={"color": GREEN, "size": 10}
    )
    figure.update_xaxes(
        title="x [m]", range=[-HALF_LENGTH - 0.1, HALF_LENGTH + 0.1], constrain="domain"
    )
    figure.update_yaxes(title="y [m]", scaleanchor="x", scaleratio=1.0)
    return styled(figure, 560)


def _errors(score: RunScore) -> go.Figure:
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    t = score.t - score.t[0]
    lines = (
        (1, "cross-track [m]", score.cross_track, BLUE, 2),
        (2, "head angle [rad]", score.head_angle, GREY, 1),
        (2, "heading, stroke mean [rad]", score.heading, BLUE, 2),
        (3, "speed [m/s]", score.speed_error, BLUE, 1),
    )
    for row, name, value, colour, width in lines:
        figure.add_scatter(
            x=t, y=value, name=name, line={"color": colour, "width": width}, row=row, col=1
        )
    for row, name in ((1, "cross-track [m]"), (2, "heading [rad]"), (3, "speed [m/s]")):
        figure.update_yaxes(title=name, row=row, col=1)
    figure.update_xaxes(title="time [s]", row=3, col=1)
    return styled(figure, 560)


def _speed(score: RunScore) -> go.Figure:
    t = score.t - score.t[0]
    figure = go.Figure()
    figure.add_scatter(x=t, y=score.speed, name="surge speed", line={"color": GREY, "width": 1})
    figure.add_scatter(
        x=t, y=stroke_mean(score.t, score.speed), name="stroke mean", line={"color": BLUE}
    )
    commanded = {"color": ORANGE, "dash": "dash", "shape": "hv"}
    figure.add_scatter(x=t, y=score.reference_speed, name="commanded", line=commanded, mode="lines")
    figure.update_xaxes(title="time [s]")
    figure.update_yaxes(title="m/s")
    return styled(figure)


def _gains(gains: Gains) -> go.Figure:
    figure = make_subplots(rows=1, cols=2)
    for k, name in enumerate(GAIN_NAMES):
        figure.add_scatter(x=gains.t, y=gains.values[:, k], name=name, row=1, col=1 + k // 3)
    figure.update_xaxes(title="time in the recording [s]")
    return styled(figure)


def _commands(commands: Commands) -> go.Figure:
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    lines = ((1, "rotor speed [rad/s]", commands.rotor_speed), (2, "rudder [rad]", commands.rudder))
    for row, name, value in lines:
        figure.add_scatter(x=commands.t, y=value, name=name, line={"width": 1}, row=row, col=1)
        figure.update_yaxes(title=name, row=row, col=1)
    figure.update_xaxes(title="time in the recording [s]", row=2, col=1)
    return styled(figure, 420)


def latency_table(diagnostics: dict[str, dict[str, str]]) -> Table:
    """What the controller says of its own latency and period."""
    said = diagnostics.get(f"{NAMESPACE.strip('/')}/controller", {})
    rows = [
        [plain(key), plain(value)]
        for key, value in said.items()
        if "latency" in key or "period" in key
    ]
    return Table(
        "Controller",
        ["value", "measured"],
        rows,
        "Latency: stamp of the measurement to the command.",
    )


def cpu_table(end: SwimEnd) -> Table:
    """What each process used."""
    rows = [[_nodes(spec), f"{100 * share:.0f} %"] for spec, share in end.cpu.items()]
    rows.append(["all nodes", f"{100 * sum(end.cpu.values()):.0f} %"])
    return Table(
        "CPU",
        ["node", "of one core"],
        rows,
        f"Processor time for the robot's own time, over {end.robot_s:.0f} s of swimming, which took {end.seconds:.0f} s.",
    )


def _nodes(spec: NodeSpec) -> str:
    """The nodes of a process."""
    return f"{spec.package}/{' + '.join(part.executable for part in spec.parts or (spec,))}"
