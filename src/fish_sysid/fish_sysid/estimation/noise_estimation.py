# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Maximum-likelihood noise of a fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum

import numpy as np

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import ENCODER_ROW, Array, Noise
from fish_sysid.estimation.encoder import encoder_noise
from fish_sysid.estimation.map_fit import Fit, likelihoods
from fish_sysid.estimation.sensor_noise import usual_noise
from fish_sysid.estimation.thresholds import (
    LONGEST_WRENCH,
    SHORTEST_WRENCH,
    WRENCH_JUMPS,
    WRENCH_LADDER,
    WRENCH_TIMES,
)

NoiseMove = Callable[[Noise, float], Noise]


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
