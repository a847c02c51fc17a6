"""Recordings: read anything into one typed data set (public names of the package)."""

from .problem import Problem, RecordingError
from .trial import DataSet, Trial

__all__ = ["DataSet", "Problem", "RecordingError", "Trial"]
