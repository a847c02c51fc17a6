# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Make scenarios of a recorded study again, diagnose them with today's tool, and compare the answers.

    python studies/compare_with_recorded.py --limit 60 --jobs 2 --out out/compare

Takes one scenario of each group in turn, quick ones first. The same command goes on where it was stopped; a larger limit adds
scenarios. An answer of another version of the tool is made again.

    python studies/compare_with_recorded.py --study studies/data/old_groups.tar.xz --without "model order" --out out/ablation

leaves out one stage of the search in the scenarios whose recorded search it changed. A search that a stage did not change
gives the same answer without it. The run ends early when two more right answers are lost than won: then the stage pays.
"""

import argparse
from pathlib import Path

from fish_report.errors import user_errors
from fish_report.terminal import print_table, terminal
from fish_study.ablation import check_stages, says_changed
from fish_study.recorded_comparison import (
    Comparison,
    comparison_tables,
    folder_of,
    lost,
    recorded_answers,
    stage_table,
)
from fish_study.runner import DIAGNOSE, Job, run_scenario, spread
from fish_study.scenario_groups import GROUPS
from fish_study.study import opened_studies, read_json
from fish_study.tool_version import tool_digest

LIMIT = 60  # scenarios by default
BATCH = 3  # scenarios of each process before it is asked whether the stage pays
ENOUGH = 2  # right answers lost, less those won, after which a stage pays
NEWEST = Path(__file__).parent / "data" / "blind_study_26.tar.xz"


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--study", type=Path, default=NEWEST, help="default: %(default)s")
    limit = "scenarios (default: 60, with --without all)"
    parser.add_argument("--limit", type=int, help=limit)
    parser.add_argument("--groups", nargs="+", choices=list(GROUPS), default=list(GROUPS))
    only = "these alone, by the end of their names, such as scenario_0045"
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help=only)
    without = "a stage of the search that is left out where it changed the recorded one"
    parser.add_argument("--without", default="", metavar="STAGE", help=without)
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the new answers")
    return parser.parse_args()


def main() -> None:
    """Choose, run what has no answer yet, compare."""
    args, console, version = arguments(), terminal(), tool_digest()
    stage = args.without
    with user_errors(), opened_studies([args.study]) as studies:
        check_stages([stage] if stage else [])
        rows = [r for r in recorded_answers(studies) if r.scenario.group in args.groups]
    if args.only:
        rows = [r for r in rows if r.name.endswith(tuple(args.only))]
    if stage:
        rows = [r for r in rows if says_changed(r.result, stage)]
    if stage and not rows:
        raise SystemExit(
            f"--without {stage}: got no search of {args.study} that this stage changed"
        )
    chosen = rows[: args.limit or (len(rows) if stage else LIMIT)]
    tool = (*DIAGNOSE, "--without", stage) if stage else DIAGNOSE
    out = args.out / stage.replace(" ", "_") if stage else args.out
    jobs = [
        Job(r.name, r.scenario, folder_of(out, r).resolve(), tool, version=version) for r in chosen
    ]

    def answered(job: Job) -> bool:
        file = job.folder / "result.json"
        return file.exists() and read_json(file)["tool"] == version

    def compared() -> list[Comparison]:
        both = zip(chosen, jobs, strict=True)
        return [Comparison(r, read_json(j.folder / "result.json")) for r, j in both if answered(j)]

    missing = [job for job in jobs if not answered(job)]
    console.print(f"{len(chosen)} scenarios, {len(missing)} of them to diagnose")
    at_once = BATCH * args.jobs if stage else max(len(missing), 1)
    for first in range(0, len(missing), at_once):
        if stage and lost(compared()) >= ENOUGH:
            break
        for name in spread(run_scenario, missing[first : first + at_once], args.jobs):
            console.print(name)
    if stage:
        print_table(console, stage_table(stage, len(chosen), compared()))
    for table in comparison_tables(compared()):
        print_table(console, table)


if __name__ == "__main__":
    main()
