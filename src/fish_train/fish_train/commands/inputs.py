"""What several verbs read: a model file, and recordings as an experiment; errors are ones the user can mend."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from fish_train.errors import UserError

FILE_WIDTH = 160  # columns when the output is not a terminal

if TYPE_CHECKING:
    from fish_sim.robot import Robot
    from fish_train.identify.experiment import Experiment
    from fish_train.recordings.topic_map import TopicMap


def terminal() -> Console:
    """The console, wide enough for the tables where the output is no terminal."""
    console = Console()
    if not console.is_terminal:
        console.width = FILE_WIDTH
    return console


@contextmanager
def user_errors() -> Iterator[None]:
    """ValueErrors of the core, whose texts are made for the user, as UserErrors."""
    try:
        yield
    except ValueError as error:
        raise UserError(str(error)) from error


def read_model(path: Path | None) -> Robot:
    """robot.yaml or model.yaml; None: the nominal robot."""
    from fish_sim.robot import Robot, load_robot

    with user_errors():
        return Robot() if path is None else load_robot(path)


def add_topic_arguments(parser: argparse.ArgumentParser) -> None:
    """How the topics of recordings are called."""
    parser.add_argument("--topics", type=Path, help="YAML topic map (default: the names of the format)")
    parser.add_argument("--namespace", help="robot's namespace (default: found from the topics)")


def topic_map(args: argparse.Namespace) -> TopicMap:
    """What these arguments say."""
    from dataclasses import replace

    from fish_train.recordings import TopicMap, load_topic_map

    with user_errors():
        topics = load_topic_map(args.topics) if args.topics else TopicMap()
    return topics if args.namespace is None else replace(topics, namespace=args.namespace)


def read_experiment(*paths: Path, topics: TopicMap | None = None) -> tuple[Experiment, list[str]]:
    """All usable trials under the paths on the filter's grid, and what was left out and why.

    topics: which topic is what; None: the default names.

    Raises UserError when no trial can be used, when one is given twice, or when the trials are not of one robot.
    """
    from fish_train.identify.experiment import ExperimentError, build_experiment
    from fish_train.recordings import read_dataset
    from fish_train.recordings.dataset import check_set, told_apart

    read, trials, left_out = [], [], []
    with user_errors():
        for path in paths:
            data = read_dataset(path, topics, progress=True)
            left_out += [problem.text for problem in data.problems if problem.kind == "unreadable_trial"]
            read += list(data)
        read = told_apart(read)
    for problem in check_set(read):
        if problem.kind == "mixed_robots":
            raise UserError(problem.text)
    for trial in read:
        try:
            build_experiment([trial])
        except ExperimentError as error:
            left_out.append(str(error))
        else:
            trials.append(trial)
    if not trials:
        raise UserError("no trial can be used: " + "; ".join(left_out))
    with user_errors():
        return build_experiment(trials), left_out
