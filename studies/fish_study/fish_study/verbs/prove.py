# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Blind study: scenarios with something hidden, the whole tool on each without the label, labels opened afterwards.

Writes commitments to the labels before the first run, results as they come, and at the end scores, opened labels and report.html.
The same command on the same folder goes on where it was stopped; --pool puts finished studies of one version together.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
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

from fish_report.errors import UserError, user_errors
from fish_report.terminal import say

if TYPE_CHECKING:
    from fish_study.new_study import Asked
    from fish_study.oracle_tables import OracleScores
    from fish_study.score import Score
    from fish_study.study import Study

GROUPS = ("single", "absorbed", "feedback", "noise", "ladder", "two", "sensor", "outside", "null")
INJECTED = "injected"
# of what makes a study; None until the command line is read, as a study that goes on must not be asked for other things
DEFAULTS: dict[str, Any] = {
    "scenarios": 300,
    "groups": list(GROUPS),
    "trials": 12,
    "duration": 20.0,
    "seed": None,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add = parser.add_argument
    number = f"number of data sets (default: {DEFAULTS['scenarios']})"
    add("--scenarios", "--worlds", type=int, help=number)
    groups = f"{', '.join(GROUPS)}, mujoco, mujoco-pair (need mujoco); default: all but mujoco's"
    add("--groups", nargs="+", metavar="GROUP", help=groups)
    recordings = (
        "a robot's own recordings: effects are put into a third of them exactly, the others are the baseline; "
        "the only group, `injected`"
    )
    add("--recordings", type=Path, metavar="FOLDER", help=recordings)
    add("--trials", type=int, help=f"per data set (default: {DEFAULTS['trials']})")
    add("--duration", type=float, help=f"s of each trial (default: {DEFAULTS['duration']:g})")
    add("--seed", type=int, help="of all scenarios (default: drawn now); recorded in study.json")
    add("--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: %(default)s)")
    add(
        "--cluster", default="", metavar="ADDRESS", help="of a Dask scheduler with this file system"
    )
    oracle = "fit the true structure too: power and errors against it"
    add("--oracle", action="store_true", help=oracle)
    add("--keep", action="store_true", help="keep the recordings (15 MB a scenario)")
    add("--out", type=Path, default=Path("prove"), help="folder (default: %(default)s)")
    _add_other_ways(parser.add_argument_group("instead of one study").add_argument)


def _add_other_ways(add: Callable[..., Any]) -> None:
    pool = "tables and page over these finished studies together, folders or archives (.tar.xz), in OUT"
    add("--pool", nargs="+", type=Path, default=[], metavar="STUDY", help=pool)
    without = "an ablation: the same scenarios with each of these stages of the search left out in turn; one table"
    add("--without", nargs="+", default=[], metavar="STAGE", help=without)
    loop = (
        "gains from the nominal, refitted, corrected model and from the plant itself, compared on the second "
        "plant with this concealed in it (nothing, wind, servo_filter, ballast, ...; needs mujoco)"
    )
    add("--close-loop", metavar="CONCEALED", help=loop)
    search = "runs of the search on the plant with --close-loop (default: %(default)s)"
    add("--search", type=int, default=40, help=search)
    trainings = "of each model with --close-loop (default: %(default)s)"
    add("--trainings", type=int, default=3, help=trainings)


def run(args: argparse.Namespace) -> int:
    """Create or go on, run, open, print, write."""
    from fish_report.terminal import terminal

    given = frozenset(name for name in DEFAULTS if getattr(args, name) is not None)
    vars(args).update({name: value for name, value in DEFAULTS.items() if name not in given})
    recordings = _recordings(args, given)
    _check(args)
    console = terminal()
    if args.close_loop:
        return _close_loop(args, console)
    with user_errors():
        from fish_study.new_study import Asked
        from fish_study.study import opened_studies

        asked = Asked(
            args.scenarios, args.groups, args.trials, args.duration, args.seed, given, recordings
        )
        if args.without:
            return _ablation(args, asked, console)
        if not args.pool:
            return _report(args, [_ran(args, asked, console)], console)
        with opened_studies(args.pool) as studies:
            return _report(args, studies, console)


def _recordings(args: argparse.Namespace, given: frozenset[str]) -> str:
    """The folder of --recordings, whose only group is `injected`; "" without it. UserError for other groups or too few."""
    if args.recordings is None and INJECTED not in args.groups:
        return ""
    if args.recordings is None or not args.recordings.is_dir():
        raise UserError(f"--recordings: got {args.recordings}; expected a folder of recordings")
    if "groups" in given and set(args.groups) != {INJECTED}:
        raise UserError(
            f"--groups: got {' '.join(args.groups)} with --recordings; expected {INJECTED}"
        )
    from fish_bag.dataset import read_dataset
    from fish_study.pair_recordings import enough

    with user_errors():
        enough(list(read_dataset(args.recordings)))
    args.groups = [INJECTED]
    return str(args.recordings.resolve())


def _check(args: argparse.Namespace) -> None:
    """Of numbers and optional packages, before anything starts."""
    few = min(args.jobs, args.search, args.trainings) < 1
    if few or args.trials < 3 or not args.duration >= 4.0:
        raise UserError("expected at least one job, search and training, three trials and 4 s")
    _need("pysindy", "--oracle", args.oracle and not args.pool)
    second = bool(args.close_loop) or any(g.startswith("mujoco") for g in args.groups)
    _need("mujoco", "the second plant", second)
    _need("distributed", "--cluster", bool(args.cluster))
    _need("torch", "--close-loop", bool(args.close_loop), "requirements-train.txt")


def _need(module: str, what: str, wanted: bool, file: str = "requirements-bench.txt") -> None:
    if wanted and find_spec(module) is None:
        raise UserError(f"{what} needs {module}: pip install -r {file} -c constraints.txt")


def _ran(args: argparse.Namespace, asked: Asked, console: Console) -> Study:
    """The study of these arguments, every scenario with a result."""
    from fish_study.new_study import begin_or_go_on
    from fish_study.runner import run_study

    began, new = time.monotonic(), not (args.out / "study.json").exists()
    study = begin_or_go_on(args.out, asked)
    all_, left = len(study.scenarios), len(study.pending)
    seconds = time.monotonic() - began
    line = (
        f"{all_} labels sealed, commitments in {args.out}/commitments.json ({seconds:.1f} s)"
        if new
        else f"going on with {args.out}: {left} of {all_} scenarios to go"
    )
    say(console, line)
    with _progress(console, "scenarios", left) as done:
        run_study(study, args.jobs, done, keep=args.keep, cluster=args.cluster)
    return study


def _report(args: argparse.Namespace, studies: list[Study], console: Console) -> int:
    """Open the labels, score, print the tables, write the page."""
    from fish_report.terminal import print_table
    from fish_study.prove_page import tables, write_prove_page
    from fish_study.score import study_scores
    from fish_study.study import check_apart

    for study in studies[1:]:
        study.check_tool(studies[0].about.get("tool", ""))
    check_apart(studies)
    for study in studies:
        _say_ended_at_wall(study.results, console)
    scores = [score for study in studies for score in study_scores(study)]
    oracle = _oracle(args, studies, scores, console) if args.oracle else None
    for table in tables(scores, oracle):
        print_table(console, table)
    args.out.mkdir(parents=True, exist_ok=True)
    about = [study.about for study in studies]
    write_prove_page(args.out / "report.html", about, scores, oracle)
    seeds = ", ".join(str(a["seed"]) for a in about)
    files = "" if args.pool else "; labels.json and commitments.json in the same folder"
    say(console, f"{args.out}/report.html; seed {seeds}{files}")
    return 0


def _say_ended_at_wall(results: Mapping[str, Mapping[str, Any]], console: Console) -> None:
    """One line where trials came to a wall of the pool: they end there and count as far as they go."""
    ended = {name: r["ended_at_wall"] for name, r in results.items() if r.get("ended_at_wall")}
    if ended:
        count = sum(map(len, ended.values()))
        say(
            console,
            f"{count} trials in {len(ended)} of {len(results)} scenarios came to a wall of the pool and end there: "
            f"{', '.join(ended)} (ended_at_wall in result.json)",
        )


def _oracle(
    args: argparse.Namespace, studies: list[Study], scores: list[Score], console: Console
) -> OracleScores:
    from fish_study.oracle_scores import score_studies
    from fish_study.oracle_tables import OracleScores

    with _progress(console, "true structures", len(scores)) as done:
        return OracleScores.of(scores, score_studies(studies, args.jobs, done, args.cluster))


def _ablation(args: argparse.Namespace, asked: Asked, console: Console) -> int:
    """The same scenarios with each stage left out in turn; table and page."""
    from fish_report.page import write_page
    from fish_report.terminal import print_table
    from fish_study.ablation import (
        ablation_studies,
        ablation_table,
        check_stages,
        run_ablation,
    )

    check_stages(args.without)
    studies = ablation_studies(args.out, asked, args.without)
    left = sum(len(study.pending) for study in studies.values())
    with _progress(console, "diagnoses", left) as done:
        run_ablation(studies, args.jobs, done, args.cluster)
    table = ablation_table(studies)
    print_table(console, table)
    (first, *_) = studies.values()
    lead = f"{len(first.scenarios)} scenarios of seed {first.about['seed']}."
    write_page(args.out / "ablation.html", "Which stages of the search pay", lead, [table])
    say(console, f"{args.out}/ablation.html")
    return 0


def _close_loop(args: argparse.Namespace, console: Console) -> int:
    """Recordings of the second plant, trainings on each model, a search on the plant, one table and page."""
    from fish_report.page import Block, Figure, write_page
    from fish_report.terminal import print_table
    from fish_study.close_loop import Plan, close_loop, loop_scenario, prepare
    from fish_study.loop_page import loop_figure, loop_table, speed_table
    from fish_train.evaluation.study import write_rows

    with user_errors():
        scenario = loop_scenario(
            args.close_loop, 1 if args.seed is None else args.seed, args.trials, args.duration
        )
        recordings = args.out / "recordings"
        plan = Plan(scenario, recordings, args.out, search=args.search, trainings=args.trainings)
        prepare(plan)
        rows = close_loop(plan, args.jobs, partial(say, console))
    result = [loop_table(rows), speed_table(rows)]
    for table in result:
        print_table(console, table)
    write_rows(args.out / "runs.csv", rows)
    lead = f"The second plant with {args.close_loop} concealed in it, seed {scenario.seed}."
    blocks: list[Block] = [*result, Figure("Every run", loop_figure(rows))]
    write_page(args.out / "loop.html", "Does a better model make better gains?", lead, blocks)
    say(console, f"{args.out}/loop.html, runs.csv")
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
                say(console, f"{name}: {count} of {total} {what}, about {left / 60.0:.0f} min left")

        yield done
