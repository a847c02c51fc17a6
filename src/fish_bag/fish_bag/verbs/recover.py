# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mend a truncated or damaged recording: every whole message is saved to a new one, what is lost is said."""

from __future__ import annotations

import argparse
import os
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording", type=Path, help=".mcap, .db3, .bag or .bag.active file, or a folder"
    )
    parser.add_argument(
        "--out", type=Path, help="folder to be made (default: <recording>_recovered)"
    )


def run(args: argparse.Namespace) -> int:
    from fish_bag.recover import recover
    from fish_report.page import Table
    from fish_report.terminal import print_table, say, terminal

    # `.` and `..` have no name of their own; a link keeps its own, so that the folder is made where the link is
    named = Path(os.path.abspath(args.recording))
    out = args.out or named.parent / f"{named.stem if named.is_file() else named.name}_recovered"
    result = recover(args.recording, out)
    console = terminal()
    title = f"{result.count} messages saved in {result.directory}"
    rows = [(topic, str(count)) for topic, count in result.saved.items()]
    print_table(console, Table(title, ("topic", "messages saved"), rows))
    seconds = (result.last_ns - result.first_ns) * 1e-9
    say(console, f"saved: {seconds:.3f} s from first to last message")
    for note in result.notes:
        say(console, f"note: {note}")
    for loss in result.lost or (() if result.notes else ("nothing: the recording was complete",)):
        say(console, f"lost: {loss}")
    return 0
