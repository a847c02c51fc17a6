# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Remake the paper's figures and table: trains nine seeds (unless they are there), swims, writes one page.

The letters go through the camera model, the IMU model and the robot's own fusion.
"""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from fish_report.errors import UserError
from fish_report.terminal import say, terminal
from fish_study import paper_numbers as paper

if TYPE_CHECKING:
    from fish_sim.robot import Robot
    from fish_train.training.run_log import CurveRow


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument(
        "--out", type=Path, default=Path("paper"), help="folder (default: %(default)s)"
    )
    parser.add_argument(
        "--weights", type=Path, help="weights file (default: of the first trained seed)"
    )
    parser.add_argument(
        "--training", type=Path, help="folder of trained seeds (default: OUT/training)"
    )
    parser.add_argument(
        "--training-seeds", type=int, default=paper.SEEDS, help="default: %(default)s"
    )
    parser.add_argument(
        "--seeds", type=int, default=3, help="runs of each letter and speed (default: %(default)s)"
    )
    parser.add_argument("--robot", type=Path, help="robot.yaml or model.yaml (default: nominal)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> int:
    """Everything; 0 when the page is written."""
    from fish_sim.robot_file import read_model
    from fish_study.paper_page import (
        better_cells,
        error_table,
        letter_blocks,
        open_loop_blocks,
        simulation_blocks,
        training_blocks,
        write_paper_page,
    )
    from fish_train.evaluation.candidates import read_policy
    from fish_train.evaluation.cells import make_cells
    from fish_train.evaluation.study import make_condition, swim_all

    if min(args.seeds, args.jobs, args.training_seeds) < 1:
        raise UserError("--seeds, --jobs and --training-seeds: expected at least 1")
    console, robot = terminal(), read_model(args.robot)
    folder = args.training or args.out / "training"
    args.out.mkdir(parents=True, exist_ok=True)
    curves, levels = trained(folder, args.training_seeds, robot, args.robot, args.jobs, console)
    candidate = read_policy(
        "trained gains", args.weights or folder / "seed_1" / "gains.safetensors"
    )
    condition = make_condition(robot)
    cells = make_cells(paper.LETTERS, paper.SPEEDS, range(args.seeds))
    say(console, f"swimming {len(cells)} letters through camera, IMU and fusion ...")
    traces, rows = swim_all(candidate, condition, cells, args.jobs)
    page = args.out / "paper.html"
    write_paper_page(
        page,
        [
            *open_loop_blocks(robot),
            *training_blocks(curves, levels),
            *simulation_blocks(candidate, condition),
            error_table(rows),
            *letter_blocks(candidate, condition, traces),
        ],
    )
    total = len(paper.LETTERS) * len(paper.SPEEDS)
    say(
        console,
        f"better than the paper's real robot in {better_cells(rows)} of {total} cells; {page}",
    )
    return 0


def trained(
    folder: Path, seeds: int, robot: Robot, file: Path | None, jobs: int, console: Console
) -> tuple[Sequence[Sequence[CurveRow]], int]:
    """Curves of the seeds, trained or continued where they are not finished; and the number of levels. file: the robot's."""
    from fish_train.training.config import TrainConfig
    from fish_train.training.curriculum import make_levels
    from fish_train.training.parallel_runs import Display, run_all
    from fish_train.training.run import Job
    from fish_train.training.run_log import read_curve
    from fish_train.verbs.train import robot_law

    config, law = TrainConfig(), robot_law(robot, file, console)
    of_robot = [] if file is None else ["--robot", file.name]

    def command(seed: int) -> str:
        return shlex.join(["robofish", "train", *of_robot, "--seed", str(seed)])

    todo = [
        Job(folder / f"seed_{seed}", config, robot, seed, command(seed), resume=True, law=law)
        for seed in range(1, seeds + 1)
    ]
    with Display(console) as display:
        run_all(todo, min(jobs, seeds), display)
    return [read_curve(job.folder) for job in todo], len(make_levels(config))
