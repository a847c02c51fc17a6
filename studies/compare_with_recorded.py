# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Make scenarios of a recorded study again, diagnose them with today's tool, and compare the answers.

    python studies/compare_with_recorded.py --limit 60 --jobs 2 --out out/compare

Takes one scenario of each group in turn, quick ones first. The same command goes on where it was stopped; a larger limit adds
scenarios. An answer of another version of the tool is made again.
"""

import argparse
from pathlib import Path

from fish_report.errors import user_errors
from fish_report.terminal import print_table, terminal
from fish_study.recorded_comparison import (
    Comparison,
    comparison_tables,
    folder_of,
    recorded_answers,
)
from fish_study.runner import Job, run_scenario, spread
from fish_study.scenario_groups import GROUPS
from fish_study.study import opened_studies, read_json
from fish_study.tool_version import tool_digest

NEWEST = Path(__file__).parent / "data" / "blind_study_26.tar.xz"


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--study", type=Path, default=NEWEST, help="default: %(default)s")
    parser.add_argument("--limit", type=int, default=60, help="scenarios (default: %(default)s)")
    parser.add_argument("--groups", nargs="+", choices=list(GROUPS), default=list(GROUPS))
    only = "these alone, by the end of their names, such as scenario_0045"
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help=only)
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the new answers")
    return parser.parse_args()


def main() -> None:
    """Choose, run what has no answer yet, compare."""
    args, console, version = arguments(), terminal(), tool_digest()
    with user_errors(), opened_studies([args.study]) as studies:
        rows = [r for r in recorded_answers(studies) if r.scenario.group in args.groups]
    if args.only:
        rows = [r for r in rows if r.name.endswith(tuple(args.only))]
    chosen = rows[: args.limit]
    jobs = [
        Job(r.name, r.scenario, folder_of(args.out, r).resolve(), version=version) for r in chosen
    ]

    def answered(job: Job) -> bool:
        file = job.folder / "result.json"
        return file.exists() and read_json(file)["tool"] == version

    missing = [job for job in jobs if not answered(job)]
    console.print(f"{len(chosen)} scenarios, {len(missing)} of them to diagnose")
    for name in spread(run_scenario, missing, args.jobs) if missing else ():
        console.print(name)
    compared = [
        Comparison(r, read_json(job.folder / "result.json"))
        for r, job in zip(chosen, jobs, strict=True)
    ]
    for table in comparison_tables(compared):
        print_table(console, table)


if __name__ == "__main__":
    main()
