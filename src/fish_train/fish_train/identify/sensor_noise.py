"""Noise to start from: of usual water, and of the sensors as their signals' roughness tells it before anything is fitted.

A fit that is told too small a sensor noise takes the rest for a rough force on the fish, and with it every parameter.
"""

from __future__ import annotations

from math import comb

import numpy as np

from fish_train.identify.experiment import Experiment
from fish_train.identify.filter_types import Array, Noise

# A tail beat of 2 Hz seen by a camera at 30 Hz is weakened 5000 times against white noise, at 100 Hz far more.
ORDER = 6
FEWEST = 50  # differences that an estimate needs
SMALLEST = 0.5  # of the usual noise: a signal that somebody has smoothed tells nothing
NORMAL_MAD = 0.6745  # median of |x| over the standard deviation of a normal distribution


def usual_noise(experiment: Experiment) -> Noise:
    """`Noise()` with sensors as noisy as they are in these recordings."""
    usual = Noise()
    poses = [np.diff(f.pose, ORDER, axis=0) for f in experiment.frames if len(f.pose) > ORDER]
    frames = np.concatenate(poses) if poses else np.zeros((0, 3))
    rough = {
        "gyro": np.diff(experiment.gyro, ORDER, axis=0),
        "accel": np.diff(experiment.accel, ORDER, axis=0),
        "camera_position": frames[:, :2],
        "camera_heading": frames[:, 2],
        "encoder": np.diff(experiment.encoder, ORDER, axis=0),
    }
    found = {name: difference_noise(values, getattr(usual, name)) for name, values in rough.items()}
    return Noise(**found)


def difference_noise(differences: Array, usual: float) -> float:
    """Standard deviation of white noise from its ORDER-th differences, by their median (Hall, Kay and Titterington 1990).

    The median leaves out jumps of the signal. Never below half the usual value; the usual one where there are too few.
    """
    size = np.abs(differences[np.isfinite(differences)])
    if len(size) < FEWEST:
        return usual
    white = float(np.median(size)) / NORMAL_MAD / comb(2 * ORDER, ORDER) ** 0.5
    return max(white, SMALLEST * usual)
