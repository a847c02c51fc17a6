"""Noise that suits a fit, by maximum likelihood, and noise and parameters in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum

import numpy as np

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import ENCODER_ROW, Array, Noise
from fish_sysid.estimation.encoder import encoder_noise
from fish_sysid.estimation.map_fit import (
    Fit,
    climb,
    evaluate,
    likelihoods,
)
from fish_sysid.estimation.sensor_noise import usual_noise

NoiseMove = Callable[[Noise, float], Noise]

SETTLED_GAIN = 3.0  # nats; a round of noise and parameters that gains less is the last
LARGE_GAIN = 100.0  # nats; a round that gains less leaves the noise near its best
SHORTEST_WRENCH, LONGEST_WRENCH = 0.02, 5.0  # s; a step of the filter is 0.01 s
JUMPS = (0.25, 4.0)  # of the wrench's standard deviations
LADDER = (4.0, 16.0, 64.0)  # times usual water's: a missing force is strong,
TIMES = (0.2, 2.0)  # and fast or slow, s


class Reach(Enum):
    """How far from a fit's noise a better one may lie."""

    NEAR = 0
    FAR = (
        1  # a model that has just found its missing effect needs far less noise than the one before
    )
    COLD = 2  # nothing is known yet


def settle(fit: Fit, experiment: Experiment, rounds: int = 5, iterations: int = 6) -> Fit:
    """Parameters and process noise in turn, from a fit that was evaluated on this experiment, until neither helps."""
    fit, gain = climb(fit, experiment, iterations), np.inf
    for _ in range(rounds):
        before = fit.objective
        noise = adapt_noise(fit, experiment, reach=Reach.NEAR if gain < LARGE_GAIN else Reach.FAR)
        fit = evaluate(fit.hypothesis, fit.theta, experiment, noise)
        if fit.objective - before < SETTLED_GAIN:
            break
        fit = climb(fit, experiment, iterations)
        gain = fit.objective - before
    return fit


def _stronger(noise: Noise, factor: float) -> Noise:
    x, y, n = noise.wrench
    return replace(noise, wrench=(factor * x, factor * y, factor * n))


def _slower(noise: Noise, factor: float) -> Noise:
    """Longer correlated at the same rate of change, sigma^2 / tau: data of a few seconds tell it far better than tau."""
    return replace(_stronger(noise, factor**0.5), wrench_time=noise.wrench_time * factor)


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


def adapt_noise(
    fit: Fit,
    experiment: Experiment,
    rounds: int = 1,
    moves: Sequence[NoiseMove] = NOISE_MOVES,
    reach: Reach = Reach.FAR,
) -> Noise:
    """Maximum-likelihood wrench intensities and their time constant: parabola through three points each, in turn.

    The encoder's noise is that of what the fit leaves of it. The start is the best of several within reach: between noises
    far apart the parabola stops half-way.
    """

    def values(noises: Sequence[Noise]) -> Array:
        return likelihoods(fit.hypothesis, fit.theta, experiment, noises)

    begin = starts(fit, experiment, reach)
    found = values(begin)
    noise, best = begin[int(np.argmax(found))], float(np.max(found))
    for _ in range(rounds):
        for change in moves:
            low, high = values([change(noise, 0.5), change(noise, 2.0)])
            if np.isinf(low) and np.isinf(high):
                continue
            curvature, slope = low + high - 2.0 * best, 0.5 * (high - low)
            parabola = np.isfinite(curvature) and curvature < 0
            octaves = -slope / curvature if parabola else np.sign(np.nan_to_num(slope)) * 2.0
            candidate = change(noise, 2.0 ** float(np.clip(octaves, -2.0, 2.0)))
            if not SHORTEST_WRENCH <= candidate.wrench_time <= LONGEST_WRENCH:
                continue
            value = float(values([candidate])[0])
            if value > best:
                noise, best = candidate, value
    return noise


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
    far = [own, sensors, calm, *(_stronger(own, f) for f in JUMPS)]
    if reach is Reach.FAR:
        return far
    return far + [replace(_stronger(calm, f), wrench_time=t) for f in LADDER for t in TIMES]
