# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is in a data set: tables for the terminal and the page, plots, and the page.

Tables: topics, clocks, problems. Plots (plotly figures): path, measurements over time, latency and gaps.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fish_bag.problem import Problem
from fish_bag.trial import DataSet, Stream, TopicSummary, Trial
from fish_report.page import Block, Figure, Table, styled, write_page

MOST_POINTS = 6000  # per line; more are thinned, flagged samples never
FLAGGED = {"mode": "markers", "marker": {"symbol": "x", "color": "crimson", "size": 8}}
Row = tuple[str, list[tuple[str, Stream, np.ndarray]]]  # axis title, lines: label, stream, values


def trials_table(data: DataSet) -> Table:
    """One row per trial."""
    rows = []
    for trial in data:
        counts = {
            s: sum(p.severity == s for p in trial.problems) for s in ("error", "warning", "info")
        }
        rows.append(
            (
                trial.name,
                f"{trial.duration:.2f}",
                str(sum(topic.count for topic in trial.topics)),
                " ".join(trial.streams),
                " ".join(str(n) for n in counts.values()),
            )
        )
    head = ("trial", "s", "messages", "contents", "errors, warnings, infos")
    return Table(f"{data.name}: {len(data)} trials", head, tuple(rows))


def topics_table(trial: Trial) -> Table:
    """One row per topic."""
    head = (
        "topic",
        "type",
        "read as",
        "messages",
        "Hz",
        "longest gap (ms)",
        "latency 1/50/99 % (ms)",
    )
    rows = [_topic_row(topic) for topic in sorted(trial.topics, key=lambda t: t.topic)]
    return Table(
        f"{trial.name}: {trial.duration:.3f} s, time axis of the {trial.axis}", head, tuple(rows)
    )


def _topic_row(topic: TopicSummary) -> tuple[str, ...]:
    latency = "/".join(_number(q * 1e3) for q in topic.latency_s) if topic.stamped else "no stamps"
    return (
        topic.topic,
        topic.type.replace("/msg/", "/"),
        topic.role or "-",
        str(topic.count),
        _number(topic.rate_hz),
        _number(topic.longest_gap_s * 1e3),
        latency,
    )


def clocks_table(trial: Trial) -> Table:
    """One row per clock; offset and drift against the recorder's, with standard errors."""
    head = ("clock", "offset (s)", "drift (ppm)", "times moved", "estimated from")
    rows = [
        (
            clock.clock,
            f"{clock.offset_s:.6f} ± {clock.offset_std_s:.1e}",
            f"{clock.drift_ppm:.1f} ± {clock.drift_std_ppm:.1f}",
            "yes" if clock.applied else "no",
            " ".join(clock.topics),
        )
        for clock in trial.clocks
    ]
    return Table("clocks: recorder minus stamp, shortest latency included", head, tuple(rows))


def problems_table(title: str, problems: tuple[Problem, ...]) -> Table:
    """One row per problem."""
    rows = [
        (p.severity, p.kind, p.topic, p.text, "" if p.t is None else f"{p.t:.3f}") for p in problems
    ]
    return Table(title, ("severity", "kind", "topic", "what", "first at (s)"), tuple(rows))


def tables(trial: Trial) -> list[Table]:
    """All tables of one trial that have rows."""
    problems = problems_table("problems (data are kept and flagged)", trial.problems)
    return [table for table in (topics_table(trial), clocks_table(trial), problems) if table.rows]


def _number(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{round(value, 3) + 0.0:.6g}"


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


def write_recording_page(data: DataSet, out: Path) -> None:
    """Write a self-contained page on all trials of a data set."""
    overview = [trials_table(data), problems_table("Problems of the set", data.problems)]
    blocks: list[Block] = [table for table in overview if table.rows]
    for trial in data:
        blocks += [*tables(trial), *figures(trial)]
    out.parent.mkdir(parents=True, exist_ok=True)
    lead = f"{len(data)} trials, {sum(trial.duration for trial in data):.1f} s in all."
    write_page(out, f"Recording {data.name}", lead, blocks)
