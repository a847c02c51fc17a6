# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors, each number once: standard deviations unless the comment says otherwise.

Sample noise, frame rate and lost frames are those of the supplied recordings. The simulator's own biases, encoder and frame
times are assumptions: its biases are larger than those of the recordings, so that an estimator that ignores them is seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GYRO = 0.006  # rad/s per sample
ACCELEROMETER = 0.05  # m/s^2 per sample
CAMERA_POSITION = 0.002  # m per axis
CAMERA_HEADING = 0.012  # rad
ENCODER_SPEED = 0.15  # rad/s per sample
CAMERA_RATE = 30.0  # Hz
CAMERA_LOSS = 0.01  # share of frames
CAMERA_LATENCY = 0.05  # s from exposure, which is the stamp, to arrival
CAMERA_JITTER = 0.002  # s, of the time of a frame
BIAS = (0.003, 0.03, 0.03)  # rad/s, m/s^2, m/s^2: constant biases of gyro and accelerometer

SIMULATOR_GYRO_BIAS = 0.01  # rad/s
SIMULATOR_ACCELEROMETER_BIAS = 0.05  # m/s^2
SIMULATOR_ENCODER_SPEED = 0.2  # rad/s per sample
SIMULATOR_CAMERA_JITTER = 0.0008  # s, of the time between frames


def exposure_times(end: float, random: np.random.Generator, rate: float = CAMERA_RATE) -> Array:
    """Times (F,) [s] of a camera's frames within [0, end]: jittered, in order, a share of them lost."""
    t = np.arange(0.0, end, 1.0 / rate)
    t = np.clip(t + CAMERA_JITTER * random.standard_normal(len(t)), 0.0, end)
    kept: Array = np.sort(t[random.random(len(t)) > CAMERA_LOSS])
    return kept
