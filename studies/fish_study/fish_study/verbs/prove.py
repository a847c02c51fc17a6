"""Blind study: worlds with something hidden, the whole tool on each without the label, labels opened afterwards.

Writes seals before the first run, results as they come, and at the end scores, opened labels and report.html. The same
command on the same folder goes on where it was stopped; --pool puts finished studies of one version together.
"""

from __future__ import annotations

import argparse
import os
import secrets
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from fish_report.command_words import words_after
from fish_report.errors import UserError

if TYPE_CHECKING:
    from fish_report.page import Table
    from fish_study.score import Score
    from fish_study.study import Study

GROUPS = ("single", "absorbed", "feedback", "noise", "ladder", "two", "sensor", "outside", "null")
# of what makes a study; None until the command line is read, as a study that goes on must not be asked for other things
DEFAULTS: dict[str, Any] = {
    "worlds": 300,
    "groups": list(GROUPS),
    "trials": 12,
    "duration": 20.0,
    "seed": None,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "--worlds", type=int, help=f"number of data sets (default: {DEFAULTS['worlds']})"
    )
    parser.add_argument(
        "--groups",
        nargs="+",
        metavar="GROUP",
        help=f"{', '.join(GROUPS)}, mujoco (needs mujoco); default: all but mujoco",
    )
    parser.add_argument("--trials", type=int, help=f"per data set (default: {DEFAULTS['trials']})")
    parser.add_argument(
        "--duration", type=float, help=f"s of each trial (default: {DEFAULTS['duration']:g})"
    )
    parser.add_argument(
        "--seed", type=int, help="of all worlds (default: drawn now); recorded in study.json"
    )
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: %(default)s)"
    )
    parser.add_argument(
        "--cluster", default="", metavar="ADDRESS", help="of a Dask scheduler with this file system"
    )
    parser.add_argument(
        "--oracle",
        action="store_true",
        help="fit the true structure too: power and errors against it",
    )
    parser.add_argument(
        "--search",
        type=int,
        default=40,
        help="runs of the search on the plant (default: %(default)s)",
    )
    parser.add_argument(
        "--trainings",
        type=int,
        default=3,
        help="of each model with --close-loop (default: %(default)s)",
    )
    parser.add_argument("--keep", action="store_true", help="keep the recordings (15 MB a world)")
    parser.add_argument(
        "--close-loop",
        metavar="CONCEALED",
        help="instead: gains from the nominal, refitted, corrected model and from the plant itself, judged on the second "
        "plant with this concealed in it (nothing, wind, servo_filter, ballast, ...; needs mujoco)",
    )
    parser.add_argument(
        "--pool",
        nargs="+",
        type=Path,
        default=[],
        metavar="STUDY",
        help="instead: tables and page over these finished studies together, in OUT",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("prove"), help="folder (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    """Create or go on, run, open, print, write."""
    from fish_report.errors import user_errors
    from fish_report.terminal import print_table, terminal
    from fish_study.oracle_scores import judge_studies
    from fish_study.prove_page import tables, write_prove_page
    from fish_study.score import score_world
    from fish_study.study import Study, check_apart
    from fish_study.truths import truths_of

    given = _given(args)
    if (
        min(args.jobs, args.search, args.trainings) < 1
        or args.trials < 3
        or not args.duration >= 4.0
    ):
        raise UserError("expected at least one job, search and training, three trials and 4 s")
    _need("pysindy", "--oracle", args.oracle)
    _need("mujoco", "the second plant", bool(args.close_loop) or "mujoco" in args.groups)
    _need("distributed", "--cluster", bool(args.cluster))
    _need("torch", "--close-loop", bool(args.close_loop), "requirements-train.txt")
    console = terminal()
    if args.close_loop:
        return _close_loop(args, console)
    with user_errors():
        studies = [Study(folder) for folder in args.pool] or [_ran(args, given, console)]
        for study in studies[1:]:
            study.check_tool(studies[0].about.get("tool", ""))
        check_apart(studies)
        scores: list[Score] = []
        oracle: dict[int, bool] = {}
        for study in studies:
            results = study.results
            say_ended_at_wall(results, console)
            scores += [score_world(w, results[n], truths_of(w)) for n, w in study.reveal().items()]
        more: list[Table] = []
        if args.oracle:
            with _progress(console, "true structures", len(scores)) as done:
                oracle, more = judge_studies(studies, scores, args.jobs, done, args.cluster)
    for table in tables(scores, oracle, more):
        print_table(console, table)
    args.out.mkdir(parents=True, exist_ok=True)
    about = [study.about for study in studies]
    write_prove_page(args.out / "report.html", about, scores, oracle, more)
    seeds = ", ".join(str(a["seed"]) for a in about)
    console.print(
        f"{args.out}/report.html; seed {seeds}; labels.json, seals.json in each study",
        soft_wrap=True,
    )
    return 0


def say_ended_at_wall(results: Mapping[str, Mapping[str, Any]], console: Console) -> None:
    """One line where trials came to a wall of the pool: they end there and count as far as they go."""
    ended = {name: r["ended_at_wall"] for name, r in results.items() if r.get("ended_at_wall")}
    if ended:
        count = sum(map(len, ended.values()))
        console.print(
            f"{count} trials in {len(ended)} of {len(results)} worlds came to a wall of the pool and end there: "
            f"{', '.join(ended)} (ended_at_wall in result.json)",
            soft_wrap=True,
        )


def _given(args: argparse.Namespace) -> dict[str, Any]:
    """What of DEFAULTS the command line gives; the rest is filled in."""
    given = {name: getattr(args, name) for name in DEFAULTS if getattr(args, name) is not None}
    vars(args).update({name: value for name, value in DEFAULTS.items() if name not in given})
    return given


def _need(module: str, what: str, wanted: bool, file: str = "requirements-bench.txt") -> None:
    """Optional packages are asked for before anything starts."""
    if wanted and find_spec(module) is None:
        raise UserError(f"{what} needs {module}: pip install -r {file} -c constraints.txt")


def _ran(args: argparse.Namespace, given: Mapping[str, Any], console: Console) -> Study:
    """The study of these arguments, every world with a result."""
    from fish_study.runner import run_study

    study = _study(args, given, console)
    with _progress(console, "worlds", len(study.open_worlds)) as done:
        run_study(study, args.jobs, done, keep=args.keep, cluster=args.cluster)
    return study


def _study(args: argparse.Namespace, given: Mapping[str, Any], console: Console) -> Study:
    """A new study, or the one in the folder, of which nothing else may be asked than what it is."""
    from dataclasses import replace

    from fish_study.scenario_groups import draw_worlds
    from fish_study.study import Study
    from fish_study.tool_version import tool_digest

    if (args.out / "study.json").exists():
        study = Study(args.out)
        study.check_asked(given)
        if study.open_worlds:
            study.check_tool(tool_digest())
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
        "drawn": args.seed is None,
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["robofish", "prove", *words_after("prove", sys.argv)]),
        "worlds": args.worlds,
        "groups": args.groups,
        "trials": args.trials,
        "duration": args.duration,
        "tool": tool_digest(),
    }
    began = time.monotonic()
    study = Study.create(args.out, worlds, about)
    console.print(
        f"{len(worlds)} labels sealed in {args.out}/seals.json ({time.monotonic() - began:.1f} s)",
        soft_wrap=True,
    )
    return study


def _close_loop(args: argparse.Namespace, console: Console) -> int:
    """Recordings of the second plant, trainings on each model, a search on the plant, one table and page."""
    from fish_report.errors import user_errors
    from fish_report.page import Block, Figure, write_page
    from fish_report.terminal import print_table
    from fish_study.close_loop import Plan, close_loop, loop_world
    from fish_study.loop_folder import prepare
    from fish_study.loop_page import loop_figure, loop_table, speed_table
    from fish_train.evaluation.study import write_rows

    with user_errors():
        world = loop_world(
            args.close_loop, 1 if args.seed is None else args.seed, args.trials, args.duration
        )
        plan = Plan(
            world, args.out / "recordings", args.out, search=args.search, trainings=args.trainings
        )
        prepare(plan)
        rows = close_loop(plan, args.jobs, console.print)
    result = [loop_table(rows), speed_table(rows)]
    for table in result:
        print_table(console, table)
    write_rows(args.out / "runs.csv", rows)
    lead = f"The second plant with {args.close_loop} concealed in it, seed {world.seed}."
    blocks: list[Block] = [*result, Figure("Every run", loop_figure(rows))]
    write_page(args.out / "loop.html", "Does a better model make better gains?", lead, blocks)
    console.print(f"{args.out}/loop.html, runs.csv", soft_wrap=True)
    return 0


@contextmanager
def _progress(console: Console, what: str, total: int) -> Iterator[Callable[[str], None]]:
    """To be called with each name that is done: a bar with the time left, or lines where there is no terminal."""
    columns = (
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    began, count = time.monotonic(), 0
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)

        def done(name: str) -> None:
            nonlocal count
            count += 1
            bar.advance(task)
            if not console.is_terminal:
                left = (time.monotonic() - began) / count * (total - count)
                console.print(
                    f"{name}: {count} of {total} {what}, about {left / 60.0:.0f} min left",
                    soft_wrap=True,
                )

        yield done
