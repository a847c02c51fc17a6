# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How well gains follow paths: any weights on any paths, speeds, plants and seeds.

Without --perfect every run goes through the camera model (noise, jitter, loss, latency), the IMU model and the
robot's own fusion. A run on a path within the pool ends, and has failed, when the robot comes to a wall; the exit status is
1 where a run failed. Writes runs.csv and a page; prints the table. Ctrl-C ends the study; the runs that are finished are
written to runs_partial.csv and evaluation_partial.html.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress

from fish_report.errors import UserError
from fish_report.files import partial_file, writable_folder
from fish_report.terminal import say, terminal

if TYPE_CHECKING:
    from fish_train.evaluation.study import Row


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument(
        "--weights", nargs="+", default=[], metavar="[NAME=]FILE", help="weights files, schedules"
    )
    parser.add_argument(
        "--constant",
        nargs="+",
        default=[],
        metavar="[NAME=]KP,KI,KD,KP,KI,KD",
        help="gains of steering and speed",
    )
    parser.add_argument(
        "--paths", nargs="+", default=["I", "R", "O", "S"], help="R, circle:radius=0.6, ..."
    )
    parser.add_argument(
        "--speeds", nargs="+", type=float, default=[0.1, 0.15, 0.2, 0.25], help="m/s"
    )
    parser.add_argument(
        "--seeds", type=int, default=3, help="runs of each cell (default: %(default)s)"
    )
    parser.add_argument(
        "--first-seed", type=int, default=0, help="of these runs (default: %(default)s)"
    )
    parser.add_argument(
        "--plant", type=Path, help="robot.yaml or model.yaml (default: the nominal robot)"
    )
    parser.add_argument(
        "--off", type=float, default=0.0, help="uncertain parameters wrong by up to this share"
    )
    parser.add_argument("--current", type=float, default=0.0, help="m/s, across the pool")
    parser.add_argument("--latency", type=float, help="s, of the camera")
    parser.add_argument(
        "--perfect", action="store_true", help="perfect state and still water instead of sensors"
    )
    parser.add_argument(
        "--robust",
        action="store_true",
        help="nominal, parameters off 30 %%, latency 0.3 s, current",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("evaluation"), help="folder (default: %(default)s)"
    )
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    """Evaluate, print, write; 1 if a run failed."""
    from fish_report.errors import user_errors
    from fish_report.terminal import print_table
    from fish_sim.robot_file import read_model
    from fish_train.evaluation.candidates import constant_candidate, read_candidate
    from fish_train.evaluation.cells import make_cells, read_path
    from fish_train.evaluation.study import make_condition, robust_conditions, run_study
    from fish_train.evaluation.tables import ratio_table, summary_table

    check_conditions(args)
    candidates = [*map(read_candidate, args.weights), *map(constant_candidate, args.constant)]
    if not candidates:
        raise UserError("nothing to evaluate: give --weights FILE or --constant KP,KI,KD,KP,KI,KD")
    check_names([candidate.name for candidate in candidates])
    if args.seeds < 1 or args.jobs < 1 or args.first_seed < 0:
        given = f"--seeds {args.seeds} --jobs {args.jobs} --first-seed {args.first_seed}"
        raise UserError(f"{given}: expected at least 1, 1 and 0")
    for path in args.paths:
        read_path(path)
    robot = read_model(args.plant)
    with user_errors():
        if args.robust:
            conditions = robust_conditions(robot)
        else:
            conditions = [make_condition(robot, args.off, args.current, args.latency, args.perfect)]
    cells = make_cells(
        args.paths, args.speeds, range(args.first_seed, args.first_seed + args.seeds)
    )
    console, began = terminal(), time.monotonic()
    total, nominal = len(candidates) * len(conditions) * len(cells), conditions[0].name
    folder = writable_folder(args.out)
    table, page = folder / "runs.csv", folder / "evaluation.html"
    swim = partial(run_study, candidates, conditions, cells, args.jobs)
    rows = _swum(swim, total, table, page, nominal, console)
    write_study(table, page, rows, nominal)
    print_table(console, summary_table(rows, "Tracking"))
    if args.robust:
        print_table(console, ratio_table(rows, nominal, "Robustness"))
    failed = [row for row in rows if row.metrics.failure]
    _say_failures(failed, console)
    spent = time.monotonic() - began
    say(console, f"{len(rows)} runs in {spent:.0f} s; {table.name} and {page.name} in {folder}")
    return 1 if failed else 0


def _swum(
    swim: Callable[..., list[Row]],
    total: int,
    table: Path,
    page: Path,
    nominal: str,
    console: Console,
) -> list[Row]:
    """All rows of a study, with progress; Ctrl-C writes those that are finished beside table and page, and goes on up."""
    finished: dict[int, list[Row]] = {}
    try:
        with Progress(console=console, transient=True) as progress:
            task = progress.add_task(f"{total} runs", total=None)

            def report(done: int, batches: int) -> None:
                progress.update(task, completed=done, total=batches)

            return swim(report, finished.__setitem__)
    except KeyboardInterrupt:
        rows = [row for _, batch in sorted(finished.items()) for row in batch]
        if rows:
            table, page = partial_file(table), partial_file(page)
            write_study(table, page, rows, nominal)
            say(
                console,
                f"{len(rows)} of {total} runs; {table.name} and {page.name} in {table.parent}",
            )
        raise


def _say_failures(failed: list[Row], console: Console) -> None:
    """The first of them, a line each."""
    for row in failed[:20]:
        cell = f"{row.cell.path} at {row.cell.speed:g} m/s, seed {row.cell.seed}"
        say(console, f"failed: {row.candidate}, {row.condition}, {cell}: {row.metrics.failure}")


def write_study(table: Path, page: Path, rows: list[Row], nominal: str) -> None:
    """All runs as CSV, and the page; nominal: the condition that the others are compared with."""
    from fish_train.evaluation.study import write_rows
    from fish_train.evaluation.tables import write_study_page

    write_rows(table, rows)
    write_study_page(page, rows, nominal)


def check_conditions(args: argparse.Namespace) -> None:
    """Refuse flags of which one would make another do nothing."""
    flags = {
        "--off": args.off != 0.0,
        "--current": args.current != 0.0,
        "--latency": args.latency is not None,
        "--perfect": args.perfect,
    }
    given = " ".join(flag for flag, is_given in flags.items() if is_given)
    if args.robust and given:
        raise UserError(
            f"--robust {given}: --robust has conditions of its own; leave out {given} or --robust"
        )
    if args.perfect and args.latency is not None:
        raise UserError(
            "--perfect --latency: with perfect state no camera takes part; leave out one of the two"
        )


def check_names(names: list[str]) -> None:
    """Refuse two candidates of one name: the tables would take them for one."""
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise UserError(
            f"{', '.join(twice)}: more than one of --weights and --constant has this name; "
            "give each its own: --weights NAME=FILE, --constant NAME=KP,KI,KD,KP,KI,KD"
        )
