"""The terminal: its console, and tables in it."""

from __future__ import annotations

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table as TerminalTable

from fish_report.page import Table

FILE_WIDTH = 160  # columns when the output is not a terminal


def terminal() -> Console:
    """The console, wide enough for the tables where the output is no terminal."""
    console = Console()
    if not console.is_terminal:
        console.width = FILE_WIDTH
    return console


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
