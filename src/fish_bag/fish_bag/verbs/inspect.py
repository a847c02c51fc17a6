# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Print and plot what is in a recording or data set: topics, rates, gaps, latency, clocks, problems."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from fish_bag.recording_files import files_under
from fish_bag.topic_map import add_topic_arguments, topic_map
from fish_report.files import named_path, writable_file
from fish_report.terminal import cell, say, terminal

if TYPE_CHECKING:
    from fish_report.page import Table as Sheet

COLOURS = {"error": "red", "warning": "yellow"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording", type=Path, help="rosbag2 folder, .mcap, .db3 or .bag file, or a folder of them"
    )
    add_topic_arguments(parser)
    parser.add_argument(
        "--html", type=Path, help="page to write (default: inspect_<name>.html here)"
    )
    parser.add_argument("--no-html", action="store_true", help="print only")


def run(args: argparse.Namespace) -> int:
    from fish_bag import read_dataset
    from fish_bag.recording_page import problems_table, tables, trials_table

    if args.html:
        writable_file(args.html, "--html", (*files_under(args.recording), args.topics))
    data = read_dataset(named_path(args.recording), topic_map(args), progress=True)
    console = terminal()
    if len(data) > 1:
        _print(console, trials_table(data))
    for trial in data:
        for sheet in tables(trial):
            _print(console, sheet)
    _print(console, problems_table("Problems of the set", data.problems))
    if not args.no_html:
        from fish_bag.recording_page import write_recording_page

        page = args.html or Path(f"inspect_{data.name}.html")
        write_recording_page(data, page)
        say(console, f"page: {page}")
    return 0


def _print(console: Console, sheet: Sheet) -> None:
    """A table, coloured by severity; nothing if it has no rows."""
    if not sheet.rows:
        return
    table = Table(title=cell(sheet.title), title_justify="left")
    for name in sheet.header:
        table.add_column(name, overflow="fold")  # on a narrow terminal names are broken, not cut
    for row in sheet.rows:
        table.add_row(*map(cell, row), style=COLOURS.get(row[0]))
    console.print(table)
