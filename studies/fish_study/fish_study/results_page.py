# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The newest study's tables as they stand in docs/results/blind_studies.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fish_report.page import Table
from fish_study.archive import opened_studies
from fish_study.asked_table import asked_table
from fish_study.calibration import calibration_table
from fish_study.group_tables import group_table
from fish_study.information_criteria import criterion_table
from fish_study.markdown import markdown_table
from fish_study.oracle_scores import score_studies
from fish_study.oracle_tables import OracleScores, competitor_table, oracle_table
from fish_study.power import power, power_table
from fish_study.score import Score, study_scores
from fish_study.study import Study


def results_text(archive: Path) -> str:
    """Markdown of an archive's tables, and of the numbers that say which studies they are."""
    with opened_studies([archive]) as studies:
        scores = [score for study in studies for score in study_scores(study)]
        oracle = OracleScores.of(scores, score_studies(studies, 1, lambda _: None))
        shown = [_measured(scores, oracle), group_table(scores)]
        return "\n".join([_studies(studies, len(scores)), *map(markdown_table, shown)])


def _measured(scores: Sequence[Score], oracle: OracleScores) -> Table:
    """One table of what is asked, what the oracle finds and what competitors do."""
    asked, truth = asked_table(scores), oracle_table(scores, oracle)
    stated = [
        [f"stated probability {edges}: first name right", "", right]
        for edges, _, right in calibration_table(scores).rows
    ]
    steps = [
        [f"strength {size}: truth in the answered set; oracle detects", "", f"{found}; {detected}"]
        for size, found, detected in power_table(power(scores, oracle.detected)).rows
    ]
    rivals = [
        [f"{name}: right name first; false alarms", "", f"{right}; {alarms}"]
        for name, right, alarms in criterion_table(scores).rows
    ]
    residual = [
        [f"{name} on the residual force: right name first; false alarms", "", f"{right}; {alarms}"]
        for name, right, alarms, _ in competitor_table(scores, oracle).rows[:2]
    ]
    rows = [*asked.rows, *truth.rows, *stated, *steps, *rivals, *residual]
    return Table(asked.title, asked.header, rows, asked.note)


def _studies(studies: Sequence[Study], scenarios: int) -> str:
    about = [study.about for study in studies]
    seeds = ", ".join(str(a["seed"]) for a in about)
    days = sorted({a["began"][:10] for a in about})
    return (
        f"{scenarios} scenarios in {len(about)} parts, begun {days[0]} to {days[-1]}, version {about[0]['tool']} of the tool."
        f" Seeds of the parts: {seeds}.\n"
    )
