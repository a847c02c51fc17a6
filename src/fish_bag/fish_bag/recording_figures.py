# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Plots of what is in a trial (plotly figures): path, measurements over time, latency and gaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fish_bag.trial import Stream, Trial
from fish_report.page import Figure, styled

MOST_POINTS = 6000  # per line; more are thinned, flagged samples never
FLAGGED = {"mode": "markers", "marker": {"symbol": "x", "color": "crimson", "size": 8}}
Row = tuple[str, list[tuple[str, Stream, np.ndarray]]]  # axis title, lines: label, stream, values


def figures(trial: Trial) -> list[Figure]:
    """All figures that the trial has data for."""
    flagged = (
        "Red crosses: flagged samples."
        if any(s.flags.any() for s in trial.streams.values())
        else ""
    )
    made = [
        Figure(f"{trial.name}: path in the pool", path_figure(trial), flagged),
        Figure(f"{trial.name}: measurements and commands", over_time(list(_rows(trial))), flagged),
        Figure(f"{trial.name}: latency and period", timing_figure(trial)),
    ]
    return [figure for figure in made if figure.figure.data]


def path_figure(trial: Trial) -> go.Figure:
    """The way through the pool, frame pool [m]."""
    figure = styled(go.Figure(), height=520)
    for name, stream in (
        ("camera", trial.camera),
        ("odometry", trial.odometry),
        ("truth", trial.truth),
    ):
        if stream is not None:
            keep = _thinned(stream)
            figure.add_scatter(x=stream.x[keep], y=stream.y[keep], name=name, mode="lines")
            _mark(figure, stream, stream.x, stream.y)
    for i, path in enumerate(trial.reference_paths):
        dash = {"dash": "dash", "color": "gray"}
        name = f"reference {i + 1}" if i else "reference"
        figure.add_scatter(x=path.points[:, 0], y=path.points[:, 1], name=name, line=dash)
    figure.update_xaxes(title="x (m)")
    figure.update_yaxes(title="y (m)", scaleanchor="x")
    return figure


def _rows(trial: Trial) -> Iterator[Row]:
    """One row of the time plot for every quantity that was recorded."""
    camera, odometry, truth = trial.camera, trial.odometry, trial.truth
    poses = [
        (k, s)
        for k, s in (("camera", camera), ("odometry", odometry), ("truth", truth))
        if s is not None
    ]
    if poses:
        yield "heading (rad)", [(name, s, _unwrapped(s.psi)) for name, s in poses]
    speeds = [(k, s) for k, s in (("odometry", odometry), ("truth", truth)) if s is not None]
    if speeds:
        yield "surge speed (m/s)", [(name, s, s.u) for name, s in speeds]
    rotor: list[tuple[str, Stream, np.ndarray]] = []
    if trial.commands is not None:
        rotor.append(("rotor command", trial.commands, trial.commands.rotor_speed))
    if trial.encoder is not None:
        rotor.append(("encoder", trial.encoder, trial.encoder.speed))
    if rotor:
        yield "rotor speed (rad/s)", rotor
    if trial.commands is not None:
        yield "rudder (rad)", [("rudder command", trial.commands, trial.commands.rudder)]
    if trial.imu is not None:
        yield "yaw rate (rad/s)", [("gyro z", trial.imu, trial.imu.gyro[:, 2])]
        yield (
            "specific force (m/s²)",
            [(f"accel {a}", trial.imu, trial.imu.accel[:, i]) for i, a in enumerate("xy")],
        )
    if trial.tail is not None:
        yield (
            "tail (rad)",
            [(name, trial.tail, trial.tail.angle[:, i]) for i, name in enumerate(trial.tail.names)],
        )
    if trial.gains is not None:
        labels = trial.gains.names or tuple(str(i) for i in range(trial.gains.values.shape[1]))
        yield (
            "gains",
            [(name, trial.gains, trial.gains.values[:, i]) for i, name in enumerate(labels)],
        )
    if trial.tracking_error is not None:
        e = trial.tracking_error
        yield (
            "tracking error",
            [(f"{k} error", e, getattr(e, k)) for k in ("cross_track", "heading", "speed")],
        )
    if trial.battery is not None:
        yield "battery (V)", [("voltage", trial.battery, trial.battery.voltage)]


def over_time(rows: list[Row]) -> go.Figure:
    """One row of axes per quantity, sharing time."""
    figure = make_subplots(rows=max(1, len(rows)), cols=1, shared_xaxes=True, vertical_spacing=0.02)
    for i, (title, lines) in enumerate(rows, start=1):
        for name, stream, values in lines:
            keep = _thinned(stream)
            figure.add_scatter(
                x=stream.t[keep], y=values[keep], name=name, mode="lines", row=i, col=1
            )
            _mark(figure, stream, stream.t, values, row=i, col=1)
        figure.update_yaxes(title=title, row=i, col=1)
    figure.update_xaxes(title="time (s)", row=max(1, len(rows)), col=1)
    return styled(figure, height=190 * len(rows) + 80)


def timing_figure(trial: Trial) -> go.Figure:
    """Latency (arrival minus stamp) and distance between stamps, for every stream."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for name, stream in trial.streams.items():
        keep = _thinned(stream)
        latency = (stream.t_arrival - stream.t)[keep] * 1e3
        if np.any(latency):
            figure.add_scatter(
                x=stream.t[keep], y=latency, name=f"{name} latency", mode="lines", row=1, col=1
            )
        t = np.sort(stream.t)
        if len(t) > 1:
            figure.add_scatter(
                x=t[1:], y=np.diff(t) * 1e3, name=f"{name} period", mode="lines", row=2, col=1
            )
    figure.update_yaxes(title="latency (ms)", row=1, col=1)
    figure.update_yaxes(title="period (ms)", row=2, col=1)
    figure.update_xaxes(title="time (s)", row=2, col=1)
    return styled(figure, height=520)


def _thinned(stream: Stream) -> np.ndarray:
    """Positions in order of time, at most MOST_POINTS, without stamps that make no sense."""
    order = np.argsort(stream.t, kind="stable")
    order = order[np.abs(stream.t[order] - stream.t_arrival[order]) < 60]
    return np.asarray(order[:: max(1, len(order) // MOST_POINTS)])


def _mark(figure: go.Figure, stream: Stream, x: np.ndarray, y: np.ndarray, **where: int) -> None:
    """Red crosses on flagged samples."""
    flagged = stream.flags != 0
    if flagged.any():
        name = f"{stream.topic} flagged"
        figure.add_scatter(
            x=x[flagged], y=y[flagged], name=name, showlegend=False, **FLAGGED, **where
        )


def _unwrapped(psi: np.ndarray) -> np.ndarray:
    """Heading without jumps by 2 pi; NaN stays where it was."""
    known = np.isfinite(psi)
    result = np.full(len(psi), np.nan)
    result[known] = np.unwrap(psi[known])
    return result
