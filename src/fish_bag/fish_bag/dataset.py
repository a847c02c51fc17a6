# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A folder of trials in, one data set out; many trials are read by several processes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fish_bag.problem import Problem, RecordingError
from fish_bag.reader import read_trial
from fish_bag.recording_files import is_recording
from fish_bag.topic_map import TopicMap
from fish_bag.trial import DataSet, Trial
from fish_report.parallel import worker_pool

PARALLEL_FROM = 16  # trials; below this starting processes costs more than it saves


def find_trials(path: Path) -> list[Path]:
    """Recordings under `path`: itself, or the recordings in that folder in order of name.

    Raises:
        RecordingError: there is none.
    """
    if not path.exists():
        raise RecordingError(f"{path}: does not exist")
    if is_recording(path):
        return [path]
    found = sorted(p for p in path.iterdir() if is_recording(p)) if path.is_dir() else []
    if not found:
        raise RecordingError(
            f"{path}: no recording; expected a rosbag2 directory, a .mcap, .db3 or .bag file, or several"
        )
    return found


def read_dataset(
    path: Path | str,
    topics: TopicMap | None = None,
    progress: bool = False,
    processes: int | None = None,
) -> DataSet:
    """Read one recording, or all recordings of a folder, into a data set.

    Args:
        topics: which topic is what; None: the default names (config/topics.yaml).
        progress: draw a progress bar on the terminal.
        processes: how many read at the same time; None: by number of trials and cores.

    Raises:
        RecordingError: no trial can be read. Single unreadable trials stand in DataSet.problems.
    """
    path = Path(path)
    paths = find_trials(path)
    trials: list[Trial] = []
    problems: list[Problem] = []
    for source, result in _read_all(paths, topics or TopicMap(), progress, processes):
        if isinstance(result, Trial):
            trials.append(result)
        else:
            problems.append(
                Problem("error", "unreadable_trial", "", f"{source.name} left out: {result}")
            )
    if not trials:
        raise RecordingError("; ".join(problem.text for problem in problems))
    trials = told_apart(trials)
    problems += check_set(trials)
    return DataSet(path.name, path, tuple(trials), tuple(problems))


def _read_all(
    paths: list[Path], topics: TopicMap, progress: bool, processes: int | None
) -> Iterator[tuple[Path, Trial | str]]:
    """Every path with its trial, or with what went wrong, in order."""
    jobs = [(path, topics) for path in paths]
    if processes is None:
        processes = (
            1 if len(paths) < PARALLEL_FROM else min(len(os.sched_getaffinity(0)), len(paths))
        )
    if processes == 1:
        yield from zip(paths, _shown(map(_read_one, jobs), len(paths), progress), strict=True)
        return
    # fork: a caller's script needs no "if __name__" guard; started before the bar, which brings a thread
    with worker_pool(processes, method="fork") as pool:
        results = pool.map(_read_one, jobs, chunksize=2)
        yield from zip(paths, _shown(results, len(paths), progress), strict=True)


def _shown(results: Iterable[Trial | str], total: int, progress: bool) -> Iterator[Trial | str]:
    """The results as they come, with a progress bar if asked for."""
    if not progress:
        yield from results
        return
    from rich.progress import (  # nodes that read recordings have no terminal
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("reading trials"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, transient=True) as bar:
        yield from bar.track(results, total=total)


def _read_one(job: tuple[Path, TopicMap]) -> Trial | str:
    try:
        return read_trial(*job)
    except RecordingError as error:
        return str(error)


def told_apart(trials: Sequence[Trial]) -> list[Trial]:
    """The trials, those of one name renamed by as much of their paths as tells them apart.

    Raises:
        RecordingError: a recording is there twice.
    """
    namesakes: dict[str, list[tuple[str, ...]]] = {}
    for trial in trials:
        namesakes.setdefault(trial.name, []).append(trial.path.resolve().parts)

    def name(trial: Trial) -> str:
        paths, own = namesakes[trial.name], trial.path.resolve().parts
        if paths.count(own) > 1:
            raise RecordingError(f"{trial.path}: given twice; expected every recording once")
        ends = (own[-count:] for count in range(1, len(own) + 1))
        return "/".join(next(end for end in ends if sum(p[-len(end) :] == end for p in paths) == 1))

    return [replace(t, name=name(t)) if len(namesakes[t.name]) > 1 else t for t in trials]


def check_set(trials: Sequence[Trial]) -> Iterator[Problem]:
    """Problems of the set as a whole: one trial, several robots."""
    if len(trials) == 1:
        text = "a single trial: nothing can be held out, errors on unseen data cannot be stated"
        yield Problem("warning", "one_trial", "", text)
    for what, values in _identities(trials).items():
        if len(values) > 1:
            text = "; ".join(
                f"{value}: {', '.join(names)}" for value, names in sorted(values.items())
            )
            yield Problem(
                "error",
                "mixed_robots",
                "",
                f"trials differ in {what} ({text}); expected one robot per data set",
            )


def _identities(trials: Sequence[Trial]) -> dict[str, dict[str, list[str]]]:
    """What a robot is known by -> value -> names of trials with that value."""
    found: dict[str, dict[str, list[str]]] = {
        "robot": {},
        "namespace": {},
        "tail segments": {},
        "battery": {},
    }
    for trial in trials:
        values = {"robot": trial.metadata.get("robot"), "namespace": trial.namespace or "/"}
        if trial.tail is not None:
            values["tail segments"] = str(len(trial.tail.names))
        if trial.battery is not None and np.isfinite(trial.battery.voltage).any():
            cells = np.nanmedian(trial.battery.voltage) / 3.7  # nominal voltage of a lithium cell
            values["battery"] = "up to 4 cells" if cells < 4.8 else "more than 4 cells"
        for what, value in values.items():
            if value is not None:
                found[what].setdefault(value, []).append(trial.name)
    return found
