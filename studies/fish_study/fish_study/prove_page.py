# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of a blind study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from fish_report.page import (
    Block,
    Figure,
    Table,
    Text,
    styled,
    write_page,
)
from fish_study.answer_tables import (
    asked_table,
    failure_table,
    group_table,
    name_table,
    pair_tables,
)
from fish_study.calibration import (
    Bin,
    Power,
    calibration,
    calibration_table,
    null_table,
    power,
    power_table,
)
from fish_study.competitors import criterion_table
from fish_study.oracle_tables import OracleScores, competitor_table, oracle_table
from fish_study.score import Score


def tables(scores: Sequence[Score], oracle: OracleScores | None = None) -> list[Table]:
    """Everything that is printed as well; of pairs of days alone what is asked of these."""
    failed = [failure_table(scores)] if any(not s.has_answer for s in scores) else []
    if all(s.scenario.pair for s in scores):
        return [*pair_tables(scores), calibration_table(scores), *failed]
    steps = power(scores, oracle.detected if oracle else None)
    nulls = null_table(scores)
    shown = [
        *pair_tables(scores),
        asked_table(scores),
        group_table(scores),
        calibration_table(scores),
        criterion_table(scores),
    ]
    shown += [power_table(steps)] if steps else []
    shown += [oracle_table(scores, oracle), competitor_table(scores, oracle)] if oracle else []
    shown += [nulls] if nulls else []
    shown.append(name_table(scores))
    return shown + failed


def write_prove_page(
    path: Path,
    about: Sequence[Mapping[str, Any]],
    scores: Sequence[Score],
    oracle: OracleScores | None = None,
) -> None:
    """Write report.html; about: what was asked for, of each study."""
    which = "; ".join(f"seed {a['seed']}, {a['began']}" for a in about)
    lead = (
        f"{len(scores)} scenarios, {sum(bool(s.truth) or s.unnamed for s in scores)} of them with something hidden; "
        f"{which}. Labels were sealed before the run, and the opened ones fit their commitments."
    )
    blocks: list[Block] = list(tables(scores, oracle))
    steps = power(scores, oracle.detected if oracle else None)
    if steps:
        blocks.append(Figure("Power over strength", _power(steps), "bars: exact 95 % intervals"))
    blocks.append(
        Figure(
            "Calibration",
            _reliability(calibration(scores)),
            "on the line the stated probabilities are right",
        )
    )
    blocks.append(
        Figure(
            "Hidden against answered",
            _confusion(scores),
            "scenarios with one hidden thing or none; first name or verdict",
        )
    )
    blocks.append(
        Text(
            "How",
            " ".join([HOW, seeds_sentence(about), *(f"Command: {a['command']}." for a in about)]),
        )
    )
    write_page(path, "Blind study of the diagnosis", lead, blocks)


HOW = (
    "Each scenario is a fish whose parameters differ from the nominal ones by up to 25 %, with something hidden in it, in its "
    "water, its actuators or its sensors. Its recordings were given to the tool as a process of its own, which gets nothing but "
    "the folder. A pair of days is given as two folders, of which OLD is the baseline; what a user recorded is not changed but "
    "for the concealed effect."
)


def seeds_sentence(about: Sequence[Mapping[str, Any]]) -> str:
    """Whether anybody could know the labels before the run; of older studies the command tells whether a seed was given."""
    given = [str(a["seed"]) for a in about if not a.get("drawn", "--seed" not in a["command"])]
    committed = "salted hashes of all labels were on disk before the first run."
    if not given:
        return f"The seeds were drawn at run time; {committed}"
    others = "" if len(given) == len(about) else " The other seeds were drawn at run time."
    which = f"Seed {given[0]} was" if len(given) == 1 else f"Seeds {', '.join(given)} were"
    return f"{which} given, and whoever knows a seed can know its labels; {committed}{others}"


def _power(steps: Sequence[Power]) -> go.Figure:
    figure = go.Figure()
    x = [p.strength for p in steps]
    _points(figure, x, [p.found for p in steps], "truth in the answered set")
    if all(p.oracle for p in steps):
        _points(figure, x, [p.oracle for p in steps], "oracle")
    figure.update_xaxes(type="log", title="strength, typical ones")
    figure.update_yaxes(range=[0, 1.05], title="share of scenarios")
    return styled(figure)


def _points(figure: go.Figure, x: Sequence[float], shares: Sequence[Any], name: str) -> None:
    y = [s.value for s in shares]
    low, high = np.array([s.interval for s in shares]).T
    error = {"type": "data", "symmetric": False, "array": high - y, "arrayminus": y - low}
    figure.add_scatter(x=x, y=y, error_y=error, name=name, mode="lines+markers")


def _reliability(bins: Sequence[Bin]) -> go.Figure:
    figure = go.Figure()
    figure.add_scatter(x=[0, 1], y=[0, 1], mode="lines", line={"color": "#999"}, name="perfect")
    if bins:
        _points(figure, [b.stated for b in bins], [b.right for b in bins], "first name right")
    figure.update_xaxes(title="stated probability")
    figure.update_yaxes(title="share right")
    return styled(figure)


def _confusion(scores: Sequence[Score]) -> go.Figure:
    own = [s for s in scores if len(s.scenario.names) < 2]
    hidden = [
        s.scenario.names[0] if s.scenario.names else f"nothing ({s.scenario.plant})" for s in own
    ]
    answered = [s.named[0] if s.named else s.verdict for s in own]
    rows, columns = sorted(set(hidden)), sorted(set(answered))
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for h, a in zip(hidden, answered, strict=True):
        counts[rows.index(h), columns.index(a)] += 1
    heat = go.Heatmap(
        z=counts,
        x=columns,
        y=rows,
        colorscale="Blues",
        text=counts,
        texttemplate="%{text}",
        showscale=False,
    )
    figure = go.Figure(heat)
    figure.update_xaxes(title="answered")
    figure.update_yaxes(title="hidden", autorange="reversed")
    return styled(figure, 160 + 22 * len(rows))
