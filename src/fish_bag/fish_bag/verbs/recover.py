"""Mend a truncated MCAP recording: every whole message is saved to a new recording, what is lost is said."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from rich.console import Console
from rich.table import Table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path, help=".mcap file or recording folder")
    parser.add_argument(
        "--out", type=Path, help="folder to be made (default: <recording>_recovered)"
    )


def run(args: argparse.Namespace) -> int:
    from fish_bag.recover import recover

    # `.` and `..` have no name of their own; a link keeps its own, so that the folder is made beside it
    named = Path(os.path.abspath(args.recording))
    out = args.out or named.parent / f"{named.stem if named.is_file() else named.name}_recovered"
    result = recover(args.recording, out)
    console = Console()
    table = Table(
        "topic", "messages saved", title=f"{result.count} messages saved in {result.directory}"
    )
    for topic, count in result.saved.items():
        table.add_row(topic, str(count))
    console.print(table)
    console.print(
        f"saved: {(result.last_ns - result.first_ns) * 1e-9:.3f} s from first to last message"
    )
    for loss in result.lost or ("nothing: the recording was complete",):
        console.print(f"lost: {loss}", soft_wrap=True)
    return 0
