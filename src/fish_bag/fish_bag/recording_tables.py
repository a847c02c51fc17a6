# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is in a data set, as rows of text: topics, clocks, problems (for the terminal and for the page)."""

from __future__ import annotations

import numpy as np

from fish_bag.problem import Problem
from fish_bag.trial import DataSet, TopicSummary, Trial
from fish_report.page import Table


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
