# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One page on what is in a data set: tables and plots."""

from __future__ import annotations

from pathlib import Path

from fish_bag.recording_figures import figures
from fish_bag.recording_tables import problems_table, tables, trials_table
from fish_bag.trial import DataSet
from fish_report.page import Block, write_page


def write_recording_page(data: DataSet, out: Path) -> None:
    """Write a self-contained page on all trials of a data set."""
    overview = [trials_table(data), problems_table("Problems of the set", data.problems)]
    blocks: list[Block] = [table for table in overview if table.rows]
    for trial in data:
        blocks += [*tables(trial), *figures(trial)]
    out.parent.mkdir(parents=True, exist_ok=True)
    lead = f"{len(data)} trials, {sum(trial.duration for trial in data):.1f} s in all."
    write_page(out, f"Recording {data.name}", lead, blocks)
