# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The terminal: its console, tables in it, and texts of foreign origin.

Texts from files and from other nodes are shown by `printable.plain` and never taken for rich's markup.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table as TerminalTable
from rich.text import Text

from fish_report.printable import LONGEST, plain

if TYPE_CHECKING:  # a page needs plotly, which a node does without
    from fish_report.page import Table

__all__ = ["PARAGRAPH", "cell", "plain", "print_table", "say", "terminal"]

PARAGRAPH = 4 * LONGEST  # characters of a text of several sentences
FILE_WIDTH = 160  # columns when the output is not a terminal


def cell(text: object, longest: int = LONGEST) -> Text:
    """A text for rich, as `plain` shows it and never taken for markup."""
    return Text(plain(text, longest))


def say(console: Console, text: object, longest: int = LONGEST, style: str = "") -> None:
    """Print one line of foreign text, unbroken, without markup and colours of its own."""
    console.print(Text(plain(text, longest), style=style), soft_wrap=True, highlight=False)


def terminal(stderr: bool = False) -> Console:
    """The console, without rich's markup and wide enough for the tables where the output is no terminal."""
    console = Console(stderr=stderr, markup=False, highlight=False)
    if not console.is_terminal:
        console.width = FILE_WIDTH
    return console


def print_table(console: Console, table: Table) -> None:
    """Show a table in the terminal."""
    shown = TerminalTable(title=cell(table.title), title_justify="left", box=SIMPLE, pad_edge=False)
    for k, name in enumerate(table.header):
        numbers = any(row[k][-1:].isdigit() for row in table.rows)
        shown.add_column(cell(name), justify="right" if k and numbers else "left", overflow="fold")
    for row in table.rows:
        shown.add_row(*map(cell, row))
    console.print(shown)
    if table.note:
        for line in table.note.splitlines():
            console.print(cell(line, PARAGRAPH), style="dim")
