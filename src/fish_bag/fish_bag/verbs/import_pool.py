# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Convert the real robot's ROS 1 bags (own message types) to recordings in the project's format."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.progress import track

NOTE = "clock: recorder minus that clock; rotor residual: median of encoder minus rebuilt command"
HEADER = [
    "recording",
    "messages",
    "robot's clock (s)",
    "camera's clock (s)",
    "rotor residual (rad/s)",
]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bags", type=Path, nargs="+", help=".bag files or folders of them")
    parser.add_argument(
        "--out", type=Path, required=True, help="folder in which every bag gets a recording"
    )


def run(args: argparse.Namespace) -> int:
    from fish_bag.dataset import find_trials
    from fish_bag.pool_import import import_bag
    from fish_report.page import Table
    from fish_report.terminal import print_table, terminal

    bags = [bag for path in args.bags for bag in find_trials(path)]
    console, rows = terminal(), []
    for bag in track(bags, "importing", console=console, transient=True):
        report = import_bag(bag, args.out / bag.stem)
        offsets = f"{report.robot_offset_s:.6f}", f"{report.camera_offset_s:.6f}"
        residual = f"{report.rotor_residual:.2f}"
        rows.append([bag.stem, str(report.messages), *offsets, residual])
    print_table(console, Table("Imported recordings", HEADER, rows, NOTE))
    return 0
