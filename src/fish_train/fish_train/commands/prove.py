"""Blind study: worlds with something hidden, the whole tool on each without the label, labels opened afterwards.

Writes seals before the first run, results as they come, and at the end scores, opened labels and report.html. The same
command on the same folder goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import os
import secrets
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from fish_train.errors import UserError

if TYPE_CHECKING:
    from fish_train.prove.study import Study

GROUPS = ("single", "absorbed", "feedback", "noise", "ladder", "two", "sensor", "outside", "null")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("--worlds", type=int, default=300, help="number of data sets (default: %(default)s)")
    parser.add_argument(
        "--groups", nargs="+", default=list(GROUPS), metavar="GROUP",
        help=f"{', '.join(GROUPS)}, mujoco (needs mujoco); default: all but mujoco",
    )  # fmt: skip
    parser.add_argument("--trials", type=int, default=12, help="per data set (default: %(default)s)")
    parser.add_argument("--duration", type=float, default=20.0, help="s of each trial (default: %(default)s)")
    parser.add_argument("--seed", type=int, help="of all worlds (default: drawn now); recorded in study.json")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: %(default)s)"
    )
    parser.add_argument(
        "--cluster", default="", metavar="ADDRESS", help="of a Dask scheduler with this file system"
    )
    parser.add_argument(
        "--oracle", action="store_true", help="fit the true structure too: power and errors against it"
    )
    parser.add_argument("--keep", action="store_true", help="keep the recordings (15 MB a world)")
    parser.add_argument("--out", type=Path, default=Path("prove"), help="folder (default: %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Create or go on, run, open, print, write."""
    from fish_train.prove.judge import judge_study
    from fish_train.prove.runner import run_study
    from fish_train.prove.score import score_world
    from fish_train.prove.truths import truths_of
    from fish_train.reports.prove_page import tables, write_prove_page
    from fish_train.score_table import print_table

    from .inputs import terminal, user_errors

    if args.jobs < 1 or args.trials < 3 or not args.duration >= 4.0:
        raise UserError("expected at least one job, three trials and 4 s")
    console = terminal()
    with user_errors():
        study = _study(args, console)
        with _bar(console) as bar:
            worlds = study.worlds
            task = bar.add_task("worlds", total=len(worlds), completed=len(worlds) - len(study.open_worlds))
            run_study(study, args.jobs, lambda _: bar.advance(task), keep=args.keep, cluster=args.cluster)
        opened, results = study.reveal(), study.results
        scores = [score_world(world, results[name], truths_of(world)) for name, world in opened.items()]
        oracle, more = {}, []
        if args.oracle:
            with _bar(console) as bar:
                task = bar.add_task("true structures", total=len(opened))
                oracle, more = judge_study(
                    study, scores, args.jobs, lambda _: bar.advance(task), args.cluster
                )
    for table in tables(scores, oracle, more):
        print_table(console, table)
    write_prove_page(study.folder / "report.html", study.about, scores, oracle, more)
    console.print(
        f"{study.folder}/report.html, labels.json, seals.json; seed {study.about['seed']}", soft_wrap=True
    )
    return 0


def _study(args: argparse.Namespace, console: Console) -> Study:
    """A new study, or the one in the folder."""
    from dataclasses import replace

    from fish_train.prove.groups import draw_worlds
    from fish_train.prove.study import Study

    if (args.out / "study.json").exists():
        study = Study(args.out)
        console.print(
            f"going on with {args.out}: {len(study.open_worlds)} of {len(study.worlds)} worlds to go",
            soft_wrap=True,
        )
        return study
    seed = secrets.randbits(62) if args.seed is None else args.seed
    worlds = draw_worlds(args.worlds, args.groups, seed)
    worlds = [replace(w, count=args.trials, duration=args.duration) for w in worlds]
    about = {
        "seed": seed,
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": " ".join(["fish_train", "prove", *sys.argv[2:]]),
        "worlds": args.worlds,
        "groups": args.groups,
        "trials": args.trials,
        "duration": args.duration,
    }
    began = time.monotonic()
    study = Study.create(args.out, worlds, about)
    console.print(
        f"{len(worlds)} labels sealed in {args.out}/seals.json ({time.monotonic() - began:.1f} s)",
        soft_wrap=True,
    )
    return study


def _bar(console: Console) -> Progress:
    return Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                    TextColumn("left"), TimeRemainingColumn(), console=console)  # fmt: skip
