"""Recordings: read anything into one typed data set (public names of the package)."""

from .dataset import find_trials, read_dataset
from .problem import Problem, RecordingError
from .reader import read_trial
from .topic_map import TopicMap, load_topic_map
from .trial import DataSet, Trial

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
