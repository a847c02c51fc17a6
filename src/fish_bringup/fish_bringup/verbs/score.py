# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Score a recorded run against its reference path: a table and a self-contained page.

A run that never came onto its path, or a recording without odometry, path or speed, is refused with a line that says what is
missing.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fish_bag import read_trial
from fish_bag.recording_files import files_under
from fish_bag.topic_map import add_topic_arguments, topic_map
from fish_bringup.run_page import write_run_page
from fish_bringup.score import error_table, score_trial, what_is_missing
from fish_report.errors import UserError
from fish_report.files import named_path, writable_file
from fish_report.terminal import print_table, say, terminal


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("recording", type=Path, help="a recording with reference/path and odometry")
    parser.add_argument(
        "--out",
        type=Path,
        help="page to write (default: score_<name>.html in the folder of the recording)",
    )
    add_topic_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Print the table of errors and write the page."""
    recording = named_path(args.recording)
    if args.out:
        writable_file(args.out, inputs=(*files_under(recording), args.topics))
    trial = read_trial(recording, topic_map(args))
    score = score_trial(trial)
    if missing := what_is_missing(score):
        raise UserError(f"{trial.name}: {missing}")
    table = error_table(score)
    print_table(terminal(), table)
    # named after the recording: it replaces neither the page of another recording in this folder nor a demo's report.html
    page = args.out or recording.parent / f"score_{trial.name}.html"
    write_run_page(page, f"Run {trial.name}", trial, score, [table])
    say(terminal(), f"page: {page}")
    return 0
