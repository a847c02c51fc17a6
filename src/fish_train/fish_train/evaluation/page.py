# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page of an evaluation: summary, robustness and the cells of each candidate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fish_report.page import Block, write_page
from fish_train.evaluation.cells import LAPS
from fish_train.evaluation.study import Row
from fish_train.evaluation.tables import (
    cell_table,
    ratio_table,
    summary_table,
    unique,
)


def write_study_page(path: Path, rows: Sequence[Row], nominal: str | None = None) -> None:
    """Tables of a study; nominal: the condition that the others are compared with, None: the first."""
    conditions = unique(rows, lambda r: r.condition)
    blocks: list[Block] = [summary_table(rows, "Tracking")]
    if len(conditions) > 1:
        blocks.append(ratio_table(rows, nominal or conditions[0], "Robustness"))
    for candidate in unique(rows, lambda r: r.candidate):
        for condition in conditions:
            mine = [r for r in rows if (r.candidate, r.condition) == (candidate, condition)]
            blocks.append(cell_table(mine, f"{candidate}: {condition}"))
    lead = f"{len(rows)} simulated runs from rest: an open path to its end, a closed one for the time of {LAPS:g} laps."
    write_page(path, "Evaluation", lead, blocks)
