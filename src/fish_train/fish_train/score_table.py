"""The tables of a scored run, for the terminal and for the page: the same cells in both."""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.table import Table as TerminalTable

from .reports.page import Table
from .score import RunScore


def error_table(score: RunScore) -> Table:
    """RMSE, 95th percentile and maximum of every error, with and without the approach phase."""
    whole, settled = score.summaries(with_approach=True), score.summaries(with_approach=False)
    rows = [
        [name, *(f"{value:.4f}" for summary in (settled[name], whole[name]) for value in _sizes(summary))]
        for name in whole
    ]
    header = ["error", "RMSE", "95 %", "max", "RMSE, all", "95 %, all", "max, all"]
    approach = "never ended" if np.isnan(score.approach_s) else f"took {score.approach_s:.1f} s"
    note = f"First three columns without the approach phase (it {approach}), last three with it."
    return Table("Tracking errors", header, rows, note)


def print_table(console: Console, table: Table) -> None:
    """Show a table in the terminal."""
    shown = TerminalTable(
        title=table.title, title_justify="left", caption=table.note or None, caption_justify="left"
    )
    for k, name in enumerate(table.header):
        shown.add_column(name, justify="left" if k == 0 else "right", no_wrap=True)
    for row in table.rows:
        shown.add_row(*row)
    console.print(shown)


def _sizes(summary: object) -> tuple[float, float, float]:
    return summary.rmse, summary.p95, summary.maximum
