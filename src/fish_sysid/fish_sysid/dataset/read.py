# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as an experiment: every usable trial, and the reason for each that is left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fish_bag import read_dataset
from fish_bag.dataset import check_set, told_apart
from fish_bag.problem import Problem
from fish_bag.topic_map import TopicMap
from fish_bag.trial import Trial
from fish_report.errors import UserError, user_errors
from fish_sysid.dataset.experiment import (
    Experiment,
    ExperimentError,
    build_experiment,
    rotor_not_followed,
)

# errors of samples that are not used
DROPPED = ("unreadable", "wrong_frame", "wrong_type", "serialization")
DEAD = "stuck"  # kind of a sensor that gives one value throughout
SET_BACK = "clock_back"  # kind of a clock that is set back; an error where that cuts out a piece of the swim
# why samples that came are not used
UNUSED = (*DROPPED, "nan", "not_measured", "time_back", "frozen")
FEWEST_MOVES = 20  # between images; of fewer, trials of a fish at rest may have the same
NOT_USED = "not used; the rest of the recording is"
USED = "used as it is, which no fit can mend"
ONCE = "each is used once"
LESS = "what is far from the others in it is used with less weight"
MEASURED = (
    "the rotor's measured speed drives the model, and nothing is said of how it follows commands; "
    "if the computer was too busy, record again on one that has time"
)


def read_experiment(*paths: Path, topics: TopicMap | None = None) -> tuple[Experiment, list[str]]:
    """All usable trials under the paths on the filter's grid, and what was left out and why.

    Args:
        paths: recordings, or folders of recordings.
        topics: which topic is what; None: the names of the format.

    Raises:
        UserError: no trial can be used, one is there twice, also as a copy of a part, or the trials are not of one robot.
    """
    trials, left_out = _usable(paths, topics)
    if (text := mixed(trials)) is not None:
        raise UserError(text)
    _check_apart(trials)
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
    together = [trial for trials in recordings for trial in trials]
    _check_apart(together)
    with user_errors():
        first, *others = (build_experiment(trials) for trials in recordings)
    if (several := mixed(together)) is not None:
        return first, others, left_out, f"{several}; record NEW and OLD with the same robot"
    return first, others, left_out, faulty(recordings[0], together[len(recordings[0]) :])


def _check_apart(trials: Sequence[Trial]) -> None:
    """Raises UserError where a recording, or a copy of most of it, is there twice: its images are the same to the last digit.

    Images that do not move, as those of a fish at rest or of a dead camera, say nothing.
    """
    seen: dict[bytes, list[int]] = {}
    moves = [_moves(trial) for trial in trials]
    for i, own in enumerate(moves):
        common = Counter(j for move in own for j in seen.get(move, ()))
        for j, count in common.items():
            fewest = min(len(own), len(moves[j]))
            if fewest >= FEWEST_MOVES and 2 * count > fewest:
                whole = len(own) == len(moves[j]) == count
                part = "" if whole else f" in part, {count} of {fewest} moves between images"
                raise UserError(
                    f"{trials[i].path} and {trials[j].path}: the same recording{part}; expected every recording once; "
                    "take one of them out"
                )
        for move in own:
            seen.setdefault(move, []).append(i)


def _moves(trial: Trial) -> set[bytes]:
    """Every image at which the fish has moved since the one before, together with that one."""
    assert trial.camera is not None
    images = np.column_stack([trial.camera.x, trial.camera.y])
    pairs = np.hstack([images[:-1], images[1:]])
    return {pair.tobytes() for pair in pairs[np.diff(images, axis=0).any(axis=1)]}


def faulty(new: Sequence[Trial], old: Sequence[Trial]) -> str | None:
    """An error, as of a unit, of most trials of one day and of none of the other; None: there is none."""
    for which, own, other, others in (("NEW", new, "OLD", old), ("OLD", old, "NEW", new)):
        found = [_faults(trial) for trial in own]
        there = {fault for trial in others for fault in _faults(trial)}
        for fault in dict.fromkeys(fault for faults in found for fault in faults):
            texts = [faults[fault] for faults in found if fault in faults]
            if fault not in there and 2 * len(texts) > len(own):
                return (
                    f"{texts[0]}; so it is in {len(texts)} of {len(own)} trials of {which} and in none of {other}; "
                    "mend it where it is published, or in the recordings, and compare again"
                )
    return None


def heading(text: str) -> str:
    """What a line of what was left out is about: some faults are told, and the recording is used all the same."""
    return (
        "Used with a fault" if text.endswith((USED, NOT_USED, ONCE, LESS, MEASURED)) else "Left out"
    )


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


def set_back(trial: Trial) -> list[str]:
    """Clocks of a trial that are set back."""
    found = [problem for problem in _of_use(trial) if problem.kind == SET_BACK]
    return [f"{trial.name} {problem.topic}: {problem.text}; {USED}" for problem in found]


def unused(trial: Trial) -> list[str]:
    """Samples of a trial that came and are not used, as those of a sensor in another frame."""
    return [f"{trial.name} {text}; {NOT_USED}" for text in _unused(trial)]


def late(trial: Trial) -> list[str]:
    """That the rotor moves at other times than the stamps of a trial's commands say, where its encoder shows that."""
    if not rotor_not_followed(trial):
        return []
    topic = trial.streams["commands"].topic
    text = "commands come irregularly, and the rotor does not move when their stamps say; nor may the rudder"
    return [f"{trial.name} {topic}: {text}; {MEASURED}"]


def _errors(trial: Trial) -> list[Problem]:
    """Such errors of a trial."""
    return [
        problem
        for problem in _of_use(trial)
        if (problem.severity == "error" or problem.kind == DEAD)
        and problem.kind not in (*DROPPED, SET_BACK)
    ]


def _unused(trial: Trial) -> list[str]:
    """Why samples of a trial are not used, which may be why it is left out."""
    return [
        f"{problem.topic}: {problem.text}" for problem in _of_use(trial) if problem.kind in UNUSED
    ]


def _faults(trial: Trial) -> dict[tuple[str, str], str]:
    """Kind and topic of each such error -> where and what it is."""
    return {(p.kind, p.topic): f"{trial.name} {p.topic}: {p.text}" for p in _errors(trial)}


def _of_use(trial: Trial) -> list[Problem]:
    """Problems of the topics that an experiment is made of, also of those that could not be read."""
    used = ("commands", "encoder", "imu", "camera")
    topics = [summary.topic for summary in trial.topics if summary.role in used]
    return [problem for problem in trial.problems if problem.topic in topics]


def _broken(trial: Trial) -> str | None:
    """Why a trial has a piece cut out and the ends joined, as its clock is set back; None: it has not."""
    found = [p for p in _of_use(trial) if p.kind == SET_BACK and p.severity == "error"]
    topics = ", ".join(problem.topic for problem in found)
    return f"{trial.name} {topics}: {found[0].text}" if found else None


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
        if (broken := _broken(trial)) is not None:
            left_out.append(broken)
            continue
        try:
            build_experiment([trial])
        except ExperimentError as error:
            left_out.append(
                "; ".join([str(error), *(p.text for p in _errors(trial)), *_unused(trial)])
            )
        else:
            trials.append(trial)
            left_out += [*repeated(trial), *unused(trial), *set_back(trial), *unusable(trial)]
            left_out += late(trial)
    if not trials:
        raise UserError("no trial can be used: " + "; ".join(left_out))
    return trials, left_out
