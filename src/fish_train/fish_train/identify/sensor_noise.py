"""Noise to start from: of usual water, and of the sensors as their signals' roughness tells it before anything is fitted.

A fit that is told too small a sensor noise takes the rest for a rough force on the fish, and with it every parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
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
    poses = [f.pose for f in experiment.frames]
    signals = {
        "gyro": list(experiment.gyro.T),
        "accel": [*experiment.accel[..., 0].T, *experiment.accel[..., 1].T],
        "camera_position": [pose[:, axis] for pose in poses for axis in (0, 1)],
        "camera_heading": [pose[:, 2] for pose in poses],
        "encoder": list(experiment.encoder.T),
    }
    usual = Noise()
    return replace(usual, **{name: white_noise(own, getattr(usual, name)) for name, own in signals.items()})


def white_noise(signals: Sequence[Array], usual: float) -> float:
    """Standard deviation of the noise of signals, NaN where there is no sample, by the median of their differences.

    Hall, Kay and Titterington 1990; the median leaves out the signal's jumps. Never below half the usual value; the usual
    one where there are too few samples.
    """
    size = np.abs(np.concatenate([np.diff(s[np.isfinite(s)], ORDER) for s in signals]))
    if len(size) < FEWEST:
        return usual
    return max(float(np.median(size)) / NORMAL_MAD / comb(2 * ORDER, ORDER) ** 0.5, SMALLEST * usual)
