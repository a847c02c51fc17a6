# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fit the robot's parameters to recordings, with standard errors, and judge them on trials left out of the fit.

Writes robot.yaml (values with std), identification.json and report.html.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from fish_bag.topic_map import add_topic_arguments, topic_map
from fish_report.errors import user_errors
from fish_report.files import writable_folder
from fish_report.terminal import PARAGRAPH, plain, say, terminal
from fish_sim.robot_file import read_model
from fish_sysid.dataset.read import line, read_experiment

FILES = ("robot.yaml", "identification.json", "report.html")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument(
        "dataset",
        type=Path,
        nargs="+",
        help="folders of trials, or single recordings, of one robot",
    )
    parser.add_argument(
        "--robot", type=Path, help="where the fit starts (default: the nominal robot)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("identified"), help="folder (default: %(default)s)"
    )
    parser.add_argument(
        "--hold-out",
        type=int,
        default=4,
        metavar="N",
        help="every N-th trial is left out, 0: none (default: %(default)s)",
    )
    parser.add_argument(
        "--effects",
        default="",
        metavar="NAME,NAME",
        help="effects that the model gets besides, their parameters free (default: none; see diagnose), or 'choose': those "
        "that predict training trials better that are left out in turn",
    )
    add_topic_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Identify, print, write."""
    from fish_report.terminal import print_table
    from fish_sysid.diagnosis.vocabulary import choosable, known
    from fish_sysid.identification import identify
    from fish_sysid.identification_result import write_identification
    from fish_sysid.reports.identify_page import write_identify_page
    from fish_sysid.reports.identify_tables import error_table, parameter_table

    console, chosen = terminal(), args.effects == "choose"
    with user_errors():
        effects = () if chosen else known([name for name in args.effects.split(",") if name])
    robot = read_model(args.robot)
    experiment, left_out = read_experiment(*args.dataset, topics=topic_map(args))
    writable_folder(args.out, names=FILES, inputs=(args.robot, args.topics))
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar, user_errors():
        task, began = bar.add_task("identifying", total=None), time.monotonic()

        def progress(text: str) -> None:
            bar.update(task, description=plain(text))
            if not console.is_terminal:
                say(console, f"{time.monotonic() - began:5.0f} s  {text}")

        result = identify(
            experiment,
            robot,
            hold_out=args.hold_out,
            report=progress,
            effects=effects,
            choose_from=choosable() if chosen else (),
        )
    write_identification(args.out, result, left_out)
    write_identify_page(args.out / "report.html", result, left_out)
    print_table(console, parameter_table(result))
    print_table(console, error_table(result.errors))
    for text in [*map(line, left_out), *result.statements]:
        say(console, f"- {text}", PARAGRAPH)
    files = f"{', '.join(FILES[:-1])} and {FILES[-1]}"
    say(console, f"{result.seconds:.0f} s; {files} in {args.out}")
    return 0
