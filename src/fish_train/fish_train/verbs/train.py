# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Learn the gains by backpropagation through simulator, control law and actuators.

Writes for every seed a folder with the weights file (gains.safetensors), a model card, the training curve
(curve.csv, TensorBoard events) and a checkpoint from which a killed run continues exactly (--resume). Any key of
the recipe (config/train.yaml) can be set: --set learning_rate=3e-4 latency=0.1 randomise=0.3
The control law's feed-forward and slip, which the weights file carries, are measured on the robot of --robot; without
one they are the nominal fish's.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from rich.console import Console

from fish_report.errors import UserError
from fish_report.robofish import words_after
from fish_report.terminal import say, terminal
from fish_sim.robot_file import read_model

if TYPE_CHECKING:
    from fish_sim.robot import Robot
    from fish_train.training.closed_loop_equations import Law


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("training"),
        help="folder of the runs (default: %(default)s)",
    )
    parser.add_argument(
        "--config", type=Path, help="recipe, a YAML file; keys left out take their defaults"
    )
    parser.add_argument(
        "--set", nargs="+", default=[], metavar="KEY=VALUE", help="values of the recipe"
    )
    parser.add_argument(
        "--robot", type=Path, help="robot.yaml or a model.yaml of the diagnosis (default: nominal)"
    )
    parser.add_argument(
        "--form",
        choices=["network", "schedule", "constant"],
        default="network",
        help="what is learned: the paper's network, or as baselines a schedule on speed and curvature, constants",
    )
    parser.add_argument(
        "--search",
        action="store_true",
        help="find a schedule or constants by differential evolution instead of gradients",
    )
    parser.add_argument("--warm-start", type=Path, help="weights file to start from")
    parser.add_argument("--seed", type=int, default=1, help="first seed (default: %(default)s)")
    parser.add_argument(
        "--seeds", type=int, default=1, help="number of runs, with consecutive seeds"
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=os.cpu_count() or 1,
        help="runs side by side (default: %(default)s)",
    )
    parser.add_argument(
        "--max-seconds",
        type=float,
        default=float("inf"),
        help="stop each run after this time, all its starts together",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="continue runs that were stopped or killed, also with a higher max_updates",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace runs that are there")


def run(args: argparse.Namespace) -> int:
    """Train; 0 when every run finished its recipe."""
    from fish_train.training.config import load_config, make_config
    from fish_train.training.parallel_runs import Display, run_all
    from fish_train.training.run import Job

    if args.seeds < 1 or args.jobs < 1 or args.seed < 0:
        raise UserError(
            f"--seed {args.seed} --seeds {args.seeds} --jobs {args.jobs}: expected counts of at least 1"
        )
    check_flags(args)
    config = make_config(
        {**(load_config(args.config) if args.config else {}), **parse_settings(args.set)}
    )
    console = terminal()
    robot = read_model(args.robot)
    law = robot_law(robot, args.robot, console)
    jobs = [
        Job(
            folder=args.out / f"seed_{seed}",
            config=config,
            robot=robot,
            seed=seed,
            command=shlex.join(["robofish", "train", *command_line(sys.argv)]),
            warm_start=args.warm_start,
            form=args.form,
            search=args.search,
            resume=args.resume,
            overwrite=args.overwrite,
            max_seconds=args.max_seconds,
            law=law,
        )
        for seed in range(args.seed, args.seed + args.seeds)
    ]
    with Display(console) as display:
        statuses = run_all(jobs, min(args.jobs, args.seeds), display)
    finished = sum(status.state == "finished" for status in statuses)
    say(
        console,
        f"{finished} of {len(statuses)} runs finished; weights, cards and curves in {args.out}",
    )
    return 0 if finished == len(statuses) else 1


def robot_law(robot: Robot, file: Path | None, console: Console) -> Law:
    """The law with the feed-forward of the robot in `file`, the nominal one's without a file."""
    from fish_train.evaluation.open_loop import DoesNotSwim, law_of_robot
    from fish_train.training.closed_loop_equations import Law

    if file is None:
        return Law()
    try:
        law = law_of_robot(robot)
    except DoesNotSwim as error:
        say(console, f"{file}: {error}; the nominal fish's feed-forward is used")
        return Law()
    limits, guidance = law.limits, law.guidance
    say(
        console,
        f"feed-forward of {file}: throttle {limits.throttle_linear:.3g} u + {limits.throttle_quadratic:.3g} u^2, in turns "
        f"alpha^2 ({limits.turn_linear:.3g} u + {limits.turn_quadratic:.3g} u^2) more; rudder {limits.curvature_gain:.3g} m "
        f"kappa; slip {guidance.slip_arm:.3g} m + {guidance.slip_time:.3g} s u",
    )
    return law


def check_flags(args: argparse.Namespace) -> None:
    """Refuse flags that contradict each other, or of which one would do nothing."""
    if args.search and args.form == "network":
        raise UserError(
            "--search: got form network; differential evolution is for --form constant or schedule"
        )
    if args.search and args.max_seconds != float("inf"):
        raise UserError(
            "--search --max-seconds: a search ends after its own number of generations; leave out --max-seconds"
        )
    if args.search and args.resume:
        raise UserError(
            "--search --resume: a search cannot be continued, it begins anew; leave out --resume, and give --overwrite where "
            "it shall replace a run"
        )
    if not args.max_seconds >= 0.0:
        raise UserError(f"--max-seconds {args.max_seconds:g}: expected at least 0 s")
    if args.resume and args.overwrite:
        raise UserError(
            "--resume --overwrite: one continues the runs that are there, the other deletes them; give one of the two"
        )


def parse_settings(settings: list[str]) -> dict[str, Any]:
    """KEY=VALUE pairs, values in YAML."""
    values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise UserError(f"--set {setting}: expected KEY=VALUE")
        try:
            value = yaml.safe_load(text)
        except (yaml.YAMLError, ValueError) as error:  # ValueError: a date that is none, 2020-13-45
            raise UserError(f"--set {setting}: {text!r} is not a value: {error}") from error
        if isinstance(value, str):  # YAML takes 3e-4 for a text
            try:
                value = float(value)
            except ValueError:
                raise UserError(
                    f"--set {setting}: expected a number or a list of numbers"
                ) from None
        values[name] = value
    return values


def command_line(argv: list[str]) -> list[str]:
    """What the user typed after the verb, folders left out: it goes into files that travel."""
    kept, skip = [], False
    for word in words_after("train", argv):
        flag, equals, value = word.partition("=") if word.startswith("--") else ("", "", word)
        if skip or _is(flag, "--resume", "--overwrite"):
            skip = False
        elif _is(flag, "--out", "--jobs"):
            skip = not equals
        else:
            kept.append(flag + equals + (Path(value).name if "/" in value else value))
    return kept


def _is(flag: str, *names: str) -> bool:
    """Whether a flag means one of these; argparse takes a beginning that no other flag has for the whole."""
    return len(flag) > len("--") and any(name.startswith(flag) for name in names)
