"""The tables of a scored run, for the terminal and for the page: the same cells in both."""

from __future__ import annotations

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table as TerminalTable

from .reports.page import Table
from .score import RunScore, Summary


def error_table(score: RunScore) -> Table:
    """RMSE, 95th percentile and maximum of every error, with and without the approach phase."""
    whole, settled = score.summaries(with_approach=True), score.summaries(with_approach=False)
    rows = [[name, *_cells(settled[name]), *_cells(whole[name])] for name in whole]
    header = ["error", "RMSE", "95 %", "max", "RMSE *", "95 % *", "max *"]
    approach = "never ended" if np.isnan(score.approach_s) else f"took {score.approach_s:.1f} s"
    note = (
        f"Without the approach phase, which {approach}; * with it. Heading: mean over a stroke of the tail."
    )
    return Table("Tracking errors", header, rows, note)


def print_table(console: Console, table: Table) -> None:
    """Show a table in the terminal."""
    shown = TerminalTable(title=table.title, title_justify="left", box=SIMPLE, pad_edge=False)
    for k, name in enumerate(table.header):
        numbers = any(row[k][-1:].isdigit() for row in table.rows)
        shown.add_column(name, justify="right" if k and numbers else "left", overflow="fold")
    for row in table.rows:
        shown.add_row(*row)
    console.print(shown)
    if table.note:
        console.print(table.note, style="dim")


def _cells(summary: Summary) -> list[str]:
    return [f"{value:.4f}" for value in (summary.rmse, summary.p95, summary.maximum)]
