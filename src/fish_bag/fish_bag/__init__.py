# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings: read anything into one typed data set (public names of the package)."""

from fish_bag.dataset import find_trials, read_dataset
from fish_bag.problem import Problem, RecordingError
from fish_bag.reader import read_trial
from fish_bag.topic_map import TopicMap, load_topic_map
from fish_bag.trial import DataSet, Trial

__all__ = [
    "DataSet",
    "Problem",
    "RecordingError",
    "TopicMap",
    "Trial",
    "find_trials",
    "load_topic_map",
    "read_dataset",
    "read_trial",
]
