# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as an experiment: every usable trial, and the reason for each that is left out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fish_bag import read_dataset
from fish_bag.dataset import check_set, told_apart
from fish_bag.problem import Problem
from fish_bag.topic_map import TopicMap
from fish_bag.trial import Trial
from fish_report.errors import UserError, user_errors
from fish_sysid.dataset.experiment import Experiment, ExperimentError, build_experiment

DROPPED = ("unreadable", "wrong_frame")  # errors of samples that are not used
DEAD = "stuck"  # kind of a sensor that gives one value throughout
UNUSED = (*DROPPED, "wrong_type", "nan", "not_measured")  # why samples that came are not used
USED = "used as it is, which no fit can mend"
ONCE = "each is used once"
LESS = "what is far from the others in it is used with less weight"


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
    """NEW, each day of OLD, what was left out, and why these days cannot be compared (None: they can).

    Raises UserError as `read_experiment`, also for a recording that two of the days hold.
    """
    days = [_usable(paths, topics) for paths in (new, *([old] for old in olds))]
    names = ["NEW", *["OLD"] * len(olds)]
    left_out = [
        f"{name} {text}" for name, (_, texts) in zip(names, days, strict=True) for text in texts
    ]
    recordings = [trials for trials, _ in days]
    _check_apart(recordings)
    with user_errors():
        first, *others = (build_experiment(trials) for trials in recordings)
    together = [trial for trials in recordings for trial in trials]
    if (several := mixed(together)) is not None:
        return first, others, left_out, f"{several}; record NEW and OLD with the same robot"
    return first, others, left_out, faulty(recordings[0], together[len(recordings[0]) :])


def _check_apart(days: Sequence[Sequence[Trial]]) -> None:
    """Raises UserError where a recording, or a copy of it, is there twice: its images are the same to the last digit."""
    seen: dict[bytes, Trial] = {}
    for trial in (trial for day in days for trial in day):
        assert trial.camera is not None
        images = np.column_stack([trial.camera.x, trial.camera.y]).tobytes()
        other = seen.setdefault(images, trial)
        if other is not trial:
            raise UserError(
                f"{trial.path} and {other.path}: the same recording; expected every recording once, in NEW or in one day of OLD"
            )


def faulty(new: Sequence[Trial], old: Sequence[Trial]) -> str | None:
    """An error, as of a unit, of most trials of one day and of none of the other; None: there is none."""
    for which, own, other, others in (("NEW", new, "OLD", old), ("OLD", old, "NEW", new)):
        found = [_faults(trial) for trial in own]
        there = {kind for trial in others for kind in _faults(trial)}
        for kind in dict.fromkeys(kind for faults in found for kind in faults):
            texts = [faults[kind] for faults in found if kind in faults]
            if kind not in there and 2 * len(texts) > len(own):
                return (
                    f"{texts[0]}; so it is in {len(texts)} of {len(own)} trials of {which} and in none of {other}; "
                    "mend it where it is published, or in the recordings, and compare again"
                )
    return None


def heading(text: str) -> str:
    """What a line of what was left out is about: some faults are told, and the recording is used all the same."""
    return "Used with a fault" if text.endswith((USED, ONCE, LESS)) else "Left out"


def line(text: str) -> str:
    """Such a line as the verbs print it."""
    return f"{heading(text).lower()}: {text}"


def mixed(trials: Sequence[Trial]) -> str | None:
    """Why the trials are of several robots; None: of one."""
    texts = (problem.text for problem in check_set(trials) if problem.kind == "mixed_robots")
    return next(texts, None)


def repeated(trial: Trial) -> list[str]:
    """What a trial holds more than once, of what an experiment is made of."""
    return [
        f"{trial.name} {problem.topic}: {problem.text}; {ONCE}"
        for problem in _of_use(trial)
        if problem.kind == "duplicate"
    ]


def unusable(trial: Trial) -> list[str]:
    """Errors of what an experiment is made of, as of a unit, and dead sensors, which no fit can mend."""
    return [f"{trial.name} {problem.topic}: {problem.text}; {USED}" for problem in _errors(trial)]


def _errors(trial: Trial) -> list[Problem]:
    """Such errors of a trial."""
    return [
        problem
        for problem in _of_use(trial)
        if (problem.severity == "error" or problem.kind == DEAD) and problem.kind not in DROPPED
    ]


def _unused(trial: Trial) -> list[str]:
    """Why samples of a trial are not used, which may be why it is left out."""
    topics = {problem.topic for problem in _of_use(trial)}
    return [
        f"{problem.topic}: {problem.text}"
        for problem in trial.problems
        if problem.kind in UNUSED and (problem.topic in topics or problem.kind == "wrong_type")
    ]


def _faults(trial: Trial) -> dict[str, str]:
    """Kind of each such error -> where and what it is."""
    return {p.kind: f"{trial.name} {p.topic}: {p.text}" for p in _errors(trial)}


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
            left_out.append(
                "; ".join([str(error), *(p.text for p in _errors(trial)), *_unused(trial)])
            )
        else:
            trials.append(trial)
            left_out += [*repeated(trial), *unusable(trial)]
    if not trials:
        raise UserError("no trial can be used: " + "; ".join(left_out))
    return trials, left_out
