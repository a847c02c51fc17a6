# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which missing physics these sensors and this program of swims can tell apart, before anybody swims.

For every name of the vocabulary: from which strength on `diagnose` can see it, what the model's own parameters take of it, and
which other names look like it. The model computes what each effect would change in the innovations of its filter, takes away
what its parameters can imitate, and compares what is left. Strengths are shares of the typical one; small effects are assumed.
PROGRAM is what `robofish excite` swims: a plan of `robofish plan_calibration`, a diagnosis.json or rows; without it, swims of
every kind. Writes a JSON file with all numbers.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fish_report.errors import user_errors
from fish_report.files import writable_file, write_json
from fish_report.terminal import print_table, terminal
from fish_sim.robot_file import read_model
from fish_sysid.verbs.plan_calibration import add_sensor_arguments, sensor_set


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument(
        "program", type=Path, nargs="?", help="JSON or YAML file (default: swims of every kind)"
    )
    parser.add_argument("--robot", type=Path, help="robot.yaml (default: the nominal robot)")
    parser.add_argument(
        "--names",
        default="",
        metavar="NAME,NAME",
        help="some names (default: the whole vocabulary)",
    )
    add_sensor_arguments(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("distinguish.json"), help="file (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    """Compute, print, write."""
    from fish_control.excitation import read_program
    from fish_sysid.design.candidate_swims import swims_of_every_kind, swims_of_program
    from fish_sysid.design.detectability import detectability, vocabulary
    from fish_sysid.reports.design_tables import as_record, distinguish_table

    console, robot = terminal(), read_model(args.robot)
    with user_errors():
        writable_file(args.out, inputs=(args.program, args.robot))
        if args.program is None:
            swims = swims_of_every_kind(robot)
        else:
            swims = swims_of_program(read_program(args.program), robot)
        names = vocabulary(robot, [name for name in args.names.split(",") if name])
        with console.status("") as line:
            found = detectability(robot, swims, names, sensor_set(args), report=line.update)
    write_json(args.out, as_record(found))
    print_table(console, distinguish_table(found))
    console.print(
        f"{len(swims.start)} swims; all numbers in {args.out}", highlight=False, soft_wrap=True
    )
    return 0
