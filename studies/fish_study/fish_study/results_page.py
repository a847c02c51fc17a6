# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The newest study's tables as Markdown, as they stand between two marks of docs/results/blind_studies.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fish_report.page import Table
from fish_study.answer_tables import asked_table, group_table
from fish_study.calibration import calibration_table, power, power_table
from fish_study.competitors import criterion_table
from fish_study.oracle_scores import score_studies
from fish_study.oracle_tables import OracleScores, competitor_table, oracle_table
from fish_study.score import Score, study_scores
from fish_study.study import Study, opened_studies

BEGIN, END = "<!-- generated: begin -->", "<!-- generated: end -->"


def markdown_table(table: Table, level: int = 3) -> str:
    """A heading, the table and its note."""
    lines = [f"{'#' * level} {table.title}", ""]
    for row in (table.header, ["---"] * len(table.header), *table.rows):
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    return "\n".join([*lines, "", *([table.note, ""] if table.note else [])])


def generated_part(page: Path) -> str:
    """What stands between the marks. Raises ValueError where a mark is missing."""
    return _parts(page)[1]


def write_generated_part(page: Path, text: str) -> None:
    """Put this between the marks. Raises ValueError where a mark is missing."""
    before, _, after = _parts(page)
    page.write_text(f"{before}{BEGIN}\n{text}{END}{after}", encoding="utf-8")


def _parts(page: Path) -> tuple[str, str, str]:
    text = page.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise ValueError(f"{page}: expected one line {BEGIN} and after it one line {END}")
    before, rest = text.split(BEGIN)
    own, after = rest.split(END)
    return before, own.removeprefix("\n"), after


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
