# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Texts of foreign origin in the terminal: shown, never obeyed and never taken for markup."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from fish_report.page import Table
from fish_report.printable import LONGEST
from fish_report.terminal import print_table, say, terminal

HOSTILE = (
    "[/x] a closing tag",
    "[bold]not bold[/bold]",
    "\x1b[31mred\x1b[0m",
    "bell \x07",
    "two\nlines",
)


@pytest.fixture
def console() -> Console:
    """As the verbs have it, written to a text."""
    result = terminal()
    result.file = StringIO()
    return result


def written(console: Console) -> str:
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("text", HOSTILE)
def test_a_line_shows_every_character(console: Console, text: str) -> None:
    say(console, text)
    line = written(console)
    assert line.count("\n") == 1
    assert "\x1b" not in line
    assert "\x07" not in line
    assert line.startswith(
        text[:2] if text.isprintable() else text.encode("unicode_escape").decode()[:5]
    )


@pytest.mark.parametrize("text", HOSTILE)
def test_a_table_shows_every_character(console: Console, text: str) -> None:
    print_table(console, Table(text, [text, "number"], [[text, "1"]], text.replace("\n", " ")))
    shown = written(console)
    assert "\x1b" not in shown
    assert "\x07" not in shown
    if text.startswith("["):
        assert shown.count(text) == 4


def test_the_console_of_the_verbs_knows_no_markup(console: Console) -> None:
    console.print("[/x] [red]text[/red]")
    assert written(console) == "[/x] [red]text[/red]\n"


def test_a_long_text_is_cut(console: Console) -> None:
    say(console, "a" * 1_000_000)
    assert LONGEST < len(written(console)) < 2 * LONGEST
