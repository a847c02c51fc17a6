# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Maximum a posteriori fit of a hypothesis on the likelihood of the innovations.

Parameters at given noise by Levenberg-Marquardt, noise of process and sensors at given parameters by parabolas.
Before a fit the wrench's noise is chosen by likelihood, so that the filter does not diverge on a wrong model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf import run_filters
from fish_sysid.estimation.ekf_types import ENCODER_ROW, FilterResult, Noise, Problem
from fish_sysid.estimation.noise_estimation import encoder_noise, usual_noise
from fish_sysid.estimation.parametrization import Hypothesis, nominal_hypothesis
from fish_sysid.estimation.thresholds import (
    INITIAL_WRENCH_LADDER,
    INNOVATION_RMS_REJECT,
    LARGEST_STEP,
    LONGEST_WRENCH,
    SHORTEST_WRENCH,
    SMALL_GAIN,
    WRENCH_JUMPS,
    WRENCH_LADDER,
    WRENCH_TIMES,
)

Array = NDArray[np.float64]
NoiseMove = Callable[[Noise, float], Noise]

SENSOR_ROWS = slice(0, 6)  # of the whitened innovations: IMU and camera


@dataclass(frozen=True)
class Fit:
    """A hypothesis at one theta and noise."""

    hypothesis: Hypothesis
    theta: Array  # (K,)
    robot: Robot
    noise: Noise
    log_likelihood: Array  # (M,) per trial
    log_posterior: float  # log likelihood of all trials + log prior of theta
    result: FilterResult
    information: Array  # (K, K) Gauss-Newton matrix of -log_posterior

    @property
    def values(self) -> dict[str, float]:
        """Free parameters by name."""
        decoded = self.hypothesis.parametrization.decode(self.theta)
        return dict(zip(self.hypothesis.free, decoded.tolist(), strict=True))

    @property
    def covariance(self) -> Array:
        """(K, K) of theta: inverse of the information."""
        return np.asarray(np.linalg.inv(self.information), float)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Of the physical values, to first order."""
        slope = self.hypothesis.parametrization.slope(self.theta)
        deviation = np.sqrt(np.diag(self.covariance)) * np.abs(slope)
        return dict(zip(self.hypothesis.free, deviation.tolist(), strict=True))

    @property
    def samples(self) -> float:
        """Scalar measurements used."""
        return float(self.result.samples.sum())

    @property
    def gradient(self) -> Array:
        """(K,) of -log_posterior."""
        prior = self.hypothesis.parametrization.prior
        return np.asarray(self.result.gradient.sum(0) + self.theta / prior**2)

    @property
    def process_noise_ratio(self) -> Array:
        """(3,) spectral density 2 sigma^2 tau of the wrench over that of usual water, which `Noise()` describes."""
        density = [2.0 * np.square(n.wrench) * n.wrench_time for n in (self.noise, Noise())]
        return np.asarray(density[0] / density[1])

    @property
    def largest_ratio(self) -> float:
        """Of `process_noise_ratio`."""
        return float(self.process_noise_ratio.max())

    @property
    def max_innovation_rms(self) -> float:
        """Largest rms of whitened innovations over IMU and camera: 1 when the noise is right, inf when the filter diverged."""
        rows = self.result.whitened[..., SENSOR_ROWS]
        count = np.isfinite(rows).sum(axis=(0, 1))
        if not np.isfinite(self.log_posterior):
            return float("inf")
        return float(np.sqrt(np.max(np.nansum(rows**2, axis=(0, 1)) / np.maximum(count, 1))))


def evaluate(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise, keep: bool = False
) -> Fit:
    """The hypothesis at theta (K,), with score and information; keep: with what the smoother needs."""
    parametrization = hypothesis.parametrization
    p, dp, sensors = parametrization.filter_inputs(theta)
    problem = Problem(experiment, parametrization.stepper, p, dp, sensors)
    (result,) = run_filters(problem, [noise], keep)
    reached = float(result.log_likelihood.sum()) + log_prior(hypothesis, theta)
    information = result.normal.sum(0) + np.diag(1.0 / parametrization.prior**2)
    robot = parametrization.robot(theta)
    return Fit(hypothesis, theta, robot, noise, result.log_likelihood, reached, result, information)


def log_prior(hypothesis: Hypothesis, theta: Array) -> float:
    """Of theta (K,) in nats, up to a constant."""
    return -0.5 * float(np.sum((theta / hypothesis.parametrization.prior) ** 2))


def climb(
    start: Fit,
    experiment: Experiment,
    iterations: int,
    small_gain: float = SMALL_GAIN,
    moving: NDArray[np.bool_] | None = None,
) -> Fit:
    """Levenberg-Marquardt with fixed noise from a fit that was evaluated on this experiment, until it gains little.

    moving: (K,) which parameters move, by default all.
    """
    parametrization, best = start.hypothesis.parametrization, start
    damping, small = 1e-3, 0
    free = np.flatnonzero(np.ones(len(best.theta), bool) if moving is None else moving)
    for _ in range(iterations):
        information = best.information[np.ix_(free, free)]
        damped = information + damping * np.diag(np.diag(information))
        move = np.zeros(len(best.theta))
        step = -np.linalg.solve(damped, best.gradient[free])
        move[free] = np.clip(step, -LARGEST_STEP, LARGEST_STEP)
        theta = parametrization.clip(best.theta + move)
        trial = evaluate(start.hypothesis, theta, experiment, start.noise)
        gain = trial.log_posterior - best.log_posterior
        if np.isfinite(gain) and gain > 0:
            best, damping = trial, max(damping / 10.0, 1e-9)
            small = small + 1 if gain < small_gain else 0
        else:
            damping *= 10.0
            small += np.isfinite(gain) and gain > -small_gain
        if small >= 1 or damping > 1e4:
            break
    return best


def better(first: Fit, second: Fit) -> Fit:
    """The one of higher posterior; a fit whose filter diverged never wins."""
    wins = second.log_posterior > first.log_posterior or not np.isfinite(first.log_posterior)
    return second if wins else first


def likelihoods(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noises: Sequence[Noise]
) -> Array:
    """(len(noises),) log likelihood of all trials under each noise; -inf where the filter diverges.

    Without derivatives, half the work of `evaluate`.
    """
    p, _, sensors = hypothesis.parametrization.filter_inputs(theta)
    plain, stepper = replace(sensors, free={}, slope={}), hypothesis.parametrization.stepper
    problem = Problem(experiment, stepper, p, np.zeros((0, len(p))), plain)
    totals = np.array([result.log_likelihood.sum() for result in run_filters(problem, noises)])
    return np.where(np.isfinite(totals), totals, -np.inf)


def log_posterior(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise
) -> float:
    """Log likelihood of all trials plus log prior of theta (K,) in nats; -inf where the filter diverges."""
    likelihood = float(likelihoods(hypothesis, theta, experiment, [noise])[0])
    return likelihood + log_prior(hypothesis, theta)


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


def initial_noise(experiment: Experiment, robot: Robot, noise: Noise) -> Noise:
    """The wrench noise of INITIAL_WRENCH_LADDER with the highest likelihood; sensor noise too where `noise` is too small."""
    hypothesis, theta = nominal_hypothesis(robot, free=()), np.zeros(0)
    scaled = [noise.ungated().with_wrench(factor) for factor in INITIAL_WRENCH_LADDER]
    best = scaled[int(np.argmax(likelihoods(hypothesis, theta, experiment, scaled)))]
    fit = evaluate(hypothesis, theta, experiment, best)
    if fit.max_innovation_rms < INNOVATION_RMS_REJECT and best is not scaled[-1]:
        return best
    return estimate_noise(fit, experiment, 2, (*SENSOR_MOVES, *NOISE_MOVES))
