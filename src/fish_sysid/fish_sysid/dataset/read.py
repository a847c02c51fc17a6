"""Recordings as an experiment: every usable trial, and the reason for each that is left out."""

from __future__ import annotations

from pathlib import Path

from fish_bag import read_dataset
from fish_bag.dataset import check_set, told_apart
from fish_bag.topic_map import TopicMap
from fish_report.errors import UserError, user_errors
from fish_sysid.dataset.experiment import Experiment, ExperimentError, build_experiment


def read_experiment(*paths: Path, topics: TopicMap | None = None) -> tuple[Experiment, list[str]]:
    """All usable trials under the paths on the filter's grid, and what was left out and why.

    Args:
        paths: recordings, or folders of recordings.
        topics: which topic is what; None: the names of the format.

    Raises:
        UserError: no trial can be used, one is given twice, or the trials are not of one robot.
    """
    read, trials, left_out = [], [], []
    with user_errors():
        for path in paths:
            data = read_dataset(path, topics, progress=True)
            left_out += [
                problem.text for problem in data.problems if problem.kind == "unreadable_trial"
            ]
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
