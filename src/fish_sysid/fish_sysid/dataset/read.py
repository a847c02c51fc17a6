# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as an experiment: every usable trial, and the reason for each that is left out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fish_bag import read_dataset
from fish_bag.dataset import check_set, told_apart
from fish_bag.problem import Problem
from fish_bag.topic_map import TopicMap
from fish_bag.trial import Trial
from fish_report.errors import UserError, user_errors
from fish_sysid.dataset.experiment import Experiment, ExperimentError, build_experiment

DROPPED = ("unreadable", "wrong_frame")  # errors of samples that are not used


def read_experiment(*paths: Path, topics: TopicMap | None = None) -> tuple[Experiment, list[str]]:
    """All usable trials under the paths on the filter's grid, and what was left out and why.

    Args:
        paths: recordings, or folders of recordings.
        topics: which topic is what; None: the names of the format.

    Raises:
        UserError: no trial can be used, one is given twice, or the trials are not of one robot.
    """
    trials, left_out = _usable(paths, topics)
    if (text := mixed(trials)) is not None:
        raise UserError(text)
    with user_errors():
        return build_experiment(trials), left_out


def read_days(
    new: Sequence[Path], olds: Sequence[Path], topics: TopicMap | None = None
) -> tuple[Experiment, list[Experiment], list[str], str | None]:
    """NEW, each day of OLD, what was left out, and why these are recordings of several robots (None: of one).

    Raises UserError as `read_experiment`.
    """
    days = [_usable(paths, topics) for paths in (new, *([old] for old in olds))]
    left_out = [text for _, texts in days for text in texts]
    with user_errors():
        first, *others = (build_experiment(trials) for trials, _ in days)
    return first, others, left_out, mixed([trial for trials, _ in days for trial in trials])


def mixed(trials: Sequence[Trial]) -> str | None:
    """Why the trials are of several robots; None: of one."""
    texts = (problem.text for problem in check_set(trials) if problem.kind == "mixed_robots")
    return next(texts, None)


def repeated(trial: Trial) -> list[str]:
    """What a trial holds more than once, of what an experiment is made of."""
    return [
        f"{trial.name} {problem.topic}: {problem.text}; each is used once"
        for problem in _of_use(trial)
        if problem.kind == "duplicate"
    ]


def unusable(trial: Trial) -> list[str]:
    """Errors of what an experiment is made of, as of a unit, that no fit can mend."""
    return [
        f"{trial.name} {problem.topic}: {problem.text}; used as it is, which no fit can mend"
        for problem in _of_use(trial)
        if problem.severity == "error" and problem.kind not in DROPPED
    ]


def _of_use(trial: Trial) -> list[Problem]:
    """Problems of the topics that an experiment is made of."""
    used = ("commands", "encoder", "imu", "camera")
    topics = [trial.streams[role].topic for role in used if role in trial.streams]
    return [problem for problem in trial.problems if problem.topic in topics]


def _usable(paths: Sequence[Path], topics: TopicMap | None) -> tuple[list[Trial], list[str]]:
    """Trials that can be put on the grid, and what was left out and why."""
    read, trials, left_out = [], [], []
    with user_errors():
        for path in paths:
            data = read_dataset(path, topics, progress=True)
            left_out += [
                problem.text for problem in data.problems if problem.kind == "unreadable_trial"
            ]
            read += list(data)
        read = told_apart(read)
    for trial in read:
        try:
            build_experiment([trial])
        except ExperimentError as error:
            left_out.append(str(error))
        else:
            trials.append(trial)
            left_out += [*repeated(trial), *unusable(trial)]
    if not trials:
        raise UserError("no trial can be used: " + "; ".join(left_out))
    return trials, left_out
