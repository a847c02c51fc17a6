# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors from the roughness of their signals, before anything is fitted.

Too small a sensor noise would be fitted as a rough force on the fish, which biases every parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import comb, sqrt

import numpy as np

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Array, Noise

ORDER = 6  # of the differences: at 30 Hz they weaken a tail beat of 2 Hz 5000 times
SLOWEST = 0.04  # s between samples; in differences of slower ones motion is left
FEWEST = 50  # differences that an estimate needs
NORMAL_MAD = 0.6745  # median of |x| over the standard deviation of a normal distribution
SMALLEST = 0.5  # of the usual noise


def usual_noise(experiment: Experiment) -> Noise:
    """`Noise()` with sensors as noisy as they are in these recordings; the encoder by its distance from the command."""
    grid: Array = DT * np.arange(experiment.length, dtype=float)
    frames = experiment.frames
    signals: dict[str, list[tuple[Array, Array]]] = {
        "gyro": [(grid, s) for s in experiment.gyro.T],
        "accel": [(grid, s) for axis in (0, 1) for s in experiment.accel[..., axis].T],
        "camera_position": [(f.t, f.pose[:, axis]) for f in frames for axis in (0, 1)],
        "camera_heading": [(f.t, f.pose[:, 2]) for f in frames],
    }
    usual = Noise()
    measured = {name: white_noise(own, getattr(usual, name)) for name, own in signals.items()}
    measured["gyro"] = max(measured["gyro"], slow_gyro(experiment))
    measured["encoder"] = encoder_noise(commanded_residual(experiment), usual.encoder)
    return replace(usual, **measured)  # type: ignore[arg-type]  # all numbers, no wrench among them


def slow_gyro(experiment: Experiment) -> float:
    """Standard deviation [rad/s] of a gyro too slow for differences, about the rate of the IMU's own orientation; else 0.

    Samples of a real IMU differ from the turn that its orientation makes by far more than white noise. The rate between two
    orientations is compared with the mean of two samples, which halves the variance.
    """
    apart = [np.zeros(0)]
    for m in range(len(experiment.names)):
        turned = experiment.heading_of(m)
        felt = DT * np.flatnonzero(np.isfinite(experiment.gyro[:, m]))
        if len(turned.t) < 2 or len(felt) < 2 or np.median(np.diff(felt)) < SLOWEST:
            continue
        middle = 0.5 * (turned.t[1:] + turned.t[:-1])
        rate = np.interp(middle, felt, experiment.gyro[np.isfinite(experiment.gyro[:, m]), m])
        apart.append(rate - np.diff(turned.psi) / np.diff(turned.t))
    off = np.concatenate(apart)
    if len(off) < FEWEST:
        return 0.0
    return sqrt(2.0) * float(np.median(np.abs(off - np.median(off)))) / NORMAL_MAD


def white_noise(signals: Sequence[tuple[Array, Array]], usual: float) -> float:
    """Standard deviation of the noise of (times [s], values; NaN: no sample) by the median of their differences.

    Hall, Kay and Titterington 1990; the median leaves out the signal's jumps. Never below half the usual value (a signal
    that somebody has smoothed tells nothing); the usual one where there are too few samples or they come too slowly.
    """
    sizes = [np.zeros(0)]
    for t, values in signals:
        there = np.isfinite(values)
        if there.sum() > ORDER and np.median(np.diff(t[there])) < SLOWEST:
            sizes.append(np.abs(np.diff(values[there], ORDER)))
    size = np.concatenate(sizes)
    if len(size) < FEWEST:
        return usual
    found = float(np.median(size)) / NORMAL_MAD / sqrt(comb(2 * ORDER, ORDER))
    return max(found, SMALLEST * usual)


def encoder_noise(residual: Array, usual: float) -> float:
    """Standard deviation [rad/s] of residuals (NaN: no sample) by their median; the usual one where there are none."""
    sizes = np.abs(residual[np.isfinite(residual)])
    return max(float(np.median(sizes)) / NORMAL_MAD, SMALLEST * usual) if len(sizes) else usual


def commanded_residual(experiment: Experiment) -> Array:
    """(T, M) encoder less the commanded speed [rad/s], which an ideal motor has one step later."""
    commanded = np.concatenate([experiment.commands[:1, :, 0], experiment.commands[:-1, :, 0]])
    return np.asarray(experiment.encoder - commanded)
