# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How often the intervals of an identification hold the truth.

Synthetic robots with parameters up to 30 % off, recorded with the sensors' noise under five kinds of commands and identified
from the nominal values. Asked: 95 % intervals hold the truth in 90 to 98 % of cases, three standard errors in at least 95 %.
Ctrl-C ends the study; the repetitions that are finished are summarised and written to NAME_partial.json.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress

from fish_report.errors import UserError
from fish_report.files import partial_file, writable_file, write_json
from fish_report.terminal import terminal

if TYPE_CHECKING:
    from fish_sysid.coverage import Repetition


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument(
        "--study", type=int, default=10, metavar="N", help="repetitions (default: %(default)s)"
    )
    parser.add_argument(
        "--trials", type=int, default=10, help="per repetition (default: %(default)s)"
    )
    parser.add_argument(
        "--duration", type=float, default=10.0, help="s of each trial (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of the first repetition (default: %(default)s)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("coverage.json"), help="file (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    """Repeat, print, write."""
    from fish_sysid.coverage import study

    if (
        args.study < 1
        or args.trials < 1
        or args.seed < 0
        or not 2.0 <= args.duration < float("inf")
    ):
        given = f"--study {args.study} --trials {args.trials} --duration {args.duration:g} --seed {args.seed}"
        raise UserError(f"{given}: expected at least 1, 1, 2 s and 0")
    out, console, began = writable_file(args.out), terminal(), time.monotonic()
    found: list[Repetition] = []
    try:
        with Progress(console=console, transient=True) as bar:
            task = bar.add_task("repetitions", total=args.study)

            def keep(repetition: Repetition) -> None:
                found.append(repetition)
                bar.advance(task)

            study(args.study, args.trials, args.duration, args.seed, keep)
    except KeyboardInterrupt:
        if found:
            tell(
                found,
                f"{len(found)} of {args.study}",
                args.trials,
                began,
                partial_file(out),
                console,
            )
        raise
    tell(found, str(args.study), args.trials, began, out, console)
    return 0


def tell(
    found: list[Repetition],
    repetitions: str,
    trials: int,
    began: float,
    out: Path,
    console: Console,
) -> None:
    """Print and write what the repetitions say; repetitions: how many they are."""
    from fish_report.page import Table
    from fish_report.terminal import print_table, say
    from fish_sysid.coverage import summarise

    result = summarise(found)
    columns = zip(
        result.names,
        result.inside95,
        result.within3,
        result.rms_score,
        result.median_error,
        strict=True,
    )
    rows = [
        [n, f"{a:.2f}", f"{b:.2f}", f"{c:.2f}", f"{100 * d:.2g} %"] for n, a, b, c, d in columns
    ]
    header = ["parameter", "in 95 %", "in 3 s.e.", "rms score", "median error"]
    print_table(
        console, Table("Coverage", header, rows, f"{repetitions} repetitions of {trials} trials.")
    )
    inside, within = result.overall
    spent = time.monotonic() - began
    say(
        console,
        f"all parameters: {inside:.3f} in 95 % intervals, {within:.3f} within 3 s.e.; {spent:.0f} s; {out}",
    )
    scores = {str(r.seed): dict(zip(r.names, r.score.tolist(), strict=True)) for r in found}
    content = {"inside95": inside, "within3": within, "seconds": spent, "scores": scores}
    write_json(out, content)
