# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Answers by group and by what is hidden, and the scenarios without an answer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_report.page import Table
from fish_study.scenario_groups import GROUPS
from fish_study.score import Score
from fish_study.share import Share


def group_table(scores: Sequence[Score]) -> Table:
    """One row per group."""
    header = [
        "group",
        "scenarios",
        "right name first",
        "truth in set",
        "set size",
        "all right",
        "a false name",
        "alarm",
        "unexplained",
        "no answer",
        "s, median",
    ]
    rows = []
    for group in GROUPS:
        own = [s for s in scores if s.scenario.group == group]
        if not own:
            continue
        named = [s for s in own if s.truth]
        sizes = [len(s.answered) for s in own if s.answered]
        rows.append(
            [
                group,
                str(len(own)),
                Share.of(named, lambda s: s.top1).short,
                Share.of(named, lambda s: s.in_set).short,
                f"{np.mean(sizes):.2f}" if sizes else "–",
                Share.of(named, lambda s: s.exact).short,
                Share.of(own, lambda s: bool(s.false_names)).short,
                Share.of(own, lambda s: s.alarm).short,
                Share.of(own, lambda s: s.verdict == "unexplained").short,
                str(sum(not s.has_answer for s in own)),
                f"{np.median([s.seconds for s in own]):.0f}",
            ]
        )
    note = "; ".join(
        f"{name}: {(f.__doc__ or '').strip().rstrip('.')}"
        for name, f in GROUPS.items()
        if any(row[0] == name for row in rows)
    )
    return Table("Groups", header, rows, note + ".")


def name_table(scores: Sequence[Score]) -> Table:
    """What was answered to each single hidden name."""
    rows = []
    for name in sorted({n for s in scores for n in s.scenario.names}):
        own = [s for s in scores if s.scenario.names == (name,)]
        answers = [", ".join(s.named) or s.verdict for s in own]
        if answers:
            counted = sorted(
                {a: answers.count(a) for a in answers}.items(), key=lambda item: -item[1]
            )
            rows.append([name, str(len(own)), "; ".join(f"{a} ({n})" for a, n in counted)])
    note = "All groups with one hidden thing, whatever its strength and noise."
    return Table("Answers by what was hidden", ["hidden", "scenarios", "answers"], rows, note)


def failure_table(scores: Sequence[Score]) -> Table:
    """Scenarios on which the tool gave no answer; they count as not right everywhere."""
    rows = [
        [
            s.scenario.group,
            ", ".join(s.scenario.names) or "nothing",
            " ".join(s.error.split())[:200],
        ]
        for s in scores
        if not s.has_answer
    ]
    return Table(
        "No answer",
        ["group", "hidden", "what was said"],
        rows,
        "A scenario without an answer counts as not right.",
    )
