"""Known effects put into recordings exactly, without a model of the fish.

A current is a change of frame: the fish swims in the same water, which now moves. An old image is a stamp that is late.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment, Frames

Array = NDArray[np.float64]


def with_current(experiment: Experiment, velocity: tuple[float, float]) -> Experiment:
    """The same fish in water that moves with `velocity` (x, y) [m/s] in the pool frame: poses move by velocity * t."""
    frames = tuple(Frames(f.t, _carried(f, np.array(velocity))) for f in experiment.frames)
    return replace(experiment, frames=frames)


def _carried(frames: Frames, velocity: Array) -> Array:
    pose = frames.pose.copy()
    pose[:, :2] += frames.t[:, None] * velocity
    return pose


def with_image_age(experiment: Experiment, age: float) -> Experiment:
    """The same recordings with every image stamped `age` [s] later than now; those after a trial's end are left out."""
    frames = []
    for f, steps in zip(experiment.frames, experiment.steps, strict=True):
        kept = f.t + age <= DT * (steps - 1)
        frames.append(Frames(f.t[kept] + age, f.pose[kept]))
    return replace(experiment, frames=tuple(frames))
