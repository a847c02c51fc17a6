# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Noise of sensors and process: from the roughness of the signals before anything is fitted, then by likelihood.

Too small a sensor noise would be fitted as a rough force on the fish, which biases every parameter. Before a fit the wrench's
noise is chosen by likelihood, so that the filter does not diverge on a wrong model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum
from math import comb, sqrt

import numpy as np

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import ENCODER_ROW, Array, Noise
from fish_sysid.estimation.map_fit import Fit, evaluate, likelihoods
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.thresholds import (
    INITIAL_WRENCH_LADDER,
    INNOVATION_RMS_REJECT,
    LONGEST_WRENCH,
    SHORTEST_WRENCH,
    WRENCH_JUMPS,
    WRENCH_LADDER,
    WRENCH_TIMES,
)

NoiseMove = Callable[[Noise, float], Noise]

ORDER = 6  # of the differences: at 30 Hz they weaken a tail beat of 2 Hz 5000 times
SLOWEST = 0.04  # s between samples; in differences of slower ones motion is left
FEWEST = 50  # differences that an estimate needs
NORMAL_MAD = 0.6745  # median of |x| over the standard deviation of a normal distribution
SMALLEST = 0.5  # of the usual noise


class Reach(Enum):
    """How far from a fit's noise a better one may lie."""

    NEAR = 0
    FAR = 1  # after a new effect a model needs far less process noise
    ANYWHERE = 2  # a first fit


def _slower(noise: Noise, factor: float) -> Noise:
    """A longer correlation time at the same sigma^2 / tau, which a few seconds determine far better than tau."""
    return replace(noise.with_wrench(factor**0.5), wrench_time=noise.wrench_time * factor)


def _wrench(index: int) -> NoiseMove:
    def change(noise: Noise, factor: float) -> Noise:
        x, y, n = (w * (factor if i == index else 1.0) for i, w in enumerate(noise.wrench))
        return replace(noise, wrench=(x, y, n))

    return change


def _field(name: str) -> NoiseMove:
    def change(noise: Noise, factor: float) -> Noise:
        return replace(noise, **{name: getattr(noise, name) * factor})

    return change


NOISE_MOVES = (*(_wrench(i) for i in range(3)), _slower)
SENSOR_MOVES = tuple(map(_field, ("gyro", "accel", "camera_position", "camera_heading")))


def estimate_noise(
    fit: Fit,
    experiment: Experiment,
    rounds: int = 1,
    moves: Sequence[NoiseMove] = NOISE_MOVES,
    reach: Reach = Reach.FAR,
) -> Noise:
    """Maximum-likelihood wrench intensities and their time constant: a parabola through three points each, in turn.

    The encoder's noise is that of the fit's residuals. The start is the best of several within reach: between noises far
    apart the parabola stops half-way.
    """

    def values(noises: Sequence[Noise]) -> Array:
        return likelihoods(fit.hypothesis, fit.theta, experiment, noises)

    begin = starts(fit, experiment, reach)
    found = values(begin)
    noise, best = begin[int(np.argmax(found))], float(np.max(found))
    for _ in range(rounds):
        for change in moves:
            low, high = values([change(noise, 0.5), change(noise, 2.0)])
            candidate = change(noise, 2.0 ** octaves(low, best, high))
            allowed = SHORTEST_WRENCH <= candidate.wrench_time <= LONGEST_WRENCH
            if (np.isinf(low) and np.isinf(high)) or not allowed:
                continue
            value = float(values([candidate])[0])
            if value > best:
                noise, best = candidate, value
    return noise


def octaves(low: float, middle: float, high: float) -> float:
    """Where a parabola through values at -1, 0 and 1 octave has its top, at most 2 octaves away; uphill where it has none."""
    if np.isinf(low) and np.isinf(high):
        return 0.0
    curvature, slope = low + high - 2.0 * middle, 0.5 * (high - low)
    parabola = np.isfinite(curvature) and curvature < 0
    top = -slope / curvature if parabola else np.sign(np.nan_to_num(slope)) * 2.0
    return float(np.clip(top, -2.0, 2.0))


def starts(fit: Fit, experiment: Experiment, reach: Reach) -> list[Noise]:
    """The fit's noise with the encoder's own, and what may be better within reach."""
    residual = fit.noise.encoder * fit.result.whitened[..., ENCODER_ROW]
    own = replace(fit.noise, encoder=encoder_noise(residual, Noise().encoder))
    if reach is Reach.NEAR:
        return [own]
    usual = usual_noise(experiment)
    calm = replace(own, wrench=usual.wrench, wrench_time=usual.wrench_time)
    sensors = replace(
        usual, encoder=own.encoder, gate_camera=own.gate_camera, gate_imu=own.gate_imu
    )
    far = [own, sensors, calm, *map(own.with_wrench, WRENCH_JUMPS)]
    if reach is Reach.FAR:
        return far
    strong = map(calm.with_wrench, WRENCH_LADDER)
    return far + [replace(noise, wrench_time=t) for noise in strong for t in WRENCH_TIMES]


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


def initial_noise(experiment: Experiment, robot: Robot, noise: Noise) -> Noise:
    """The wrench noise of INITIAL_WRENCH_LADDER with the highest likelihood; sensor noise too where `noise` is too small."""
    hypothesis, theta = nominal_hypothesis(robot, free=()), np.zeros(0)
    scaled = [noise.ungated().with_wrench(factor) for factor in INITIAL_WRENCH_LADDER]
    best = scaled[int(np.argmax(likelihoods(hypothesis, theta, experiment, scaled)))]
    fit = evaluate(hypothesis, theta, experiment, best)
    if fit.max_innovation_rms < INNOVATION_RMS_REJECT and best is not scaled[-1]:
        return best
    return estimate_noise(fit, experiment, 2, (*SENSOR_MOVES, *NOISE_MOVES))


def encoder_noise(residual: Array, usual: float) -> float:
    """Standard deviation [rad/s] of residuals (NaN: no sample) by their median; the usual one where there are none."""
    sizes = np.abs(residual[np.isfinite(residual)])
    return max(float(np.median(sizes)) / NORMAL_MAD, SMALLEST * usual) if len(sizes) else usual


def commanded_residual(experiment: Experiment) -> Array:
    """(T, M) encoder less the commanded speed [rad/s], which an ideal motor has one step later."""
    commanded = np.concatenate([experiment.commands[:1, :, 0], experiment.commands[:-1, :, 0]])
    return np.asarray(experiment.encoder - commanded)
