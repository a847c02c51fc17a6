# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Maximum a posteriori fit of a hypothesis at given noise: Levenberg-Marquardt on the likelihood of the innovations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf import run_filters
from fish_sysid.estimation.ekf_types import FilterResult, Noise, Problem
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.thresholds import LARGEST_STEP, SMALL_GAIN

Array = NDArray[np.float64]

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
