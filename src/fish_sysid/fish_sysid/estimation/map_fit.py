"""Fit a hypothesis: Levenberg-Marquardt on the innovations' likelihood at given noise.

`adapt` estimates the noise; `tempering` puts the two together to a fit that converges from afar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf import run_filter, run_filters
from fish_sysid.estimation.ekf_types import FilterResult, Noise, Problem
from fish_sysid.estimation.parametrization import Coordinates, Hypothesis

Array = NDArray[np.float64]

LARGEST_STEP = 0.5  # of theta in one iteration
SMALL_GAIN = 0.05  # nats; below it an iteration has converged


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis."""

    hypothesis: Hypothesis
    theta: Array  # (K,)
    robot: Robot
    noise: Noise
    log_likelihood: Array  # (M,) per trial
    objective: float  # log likelihood of all trials + log prior of theta
    result: FilterResult
    normal: Array  # (K, K) Gauss-Newton matrix of -objective

    @property
    def values(self) -> dict[str, float]:
        """Free parameters by name."""
        decoded = Coordinates(self.hypothesis).decode(self.theta)
        return dict(zip(self.hypothesis.free, decoded.tolist(), strict=True))

    @property
    def covariance(self) -> Array:
        """(K, K) of theta: inverse of the normal matrix."""
        return np.asarray(np.linalg.inv(self.normal), float)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Of the physical values, to first order."""
        slope = Coordinates(self.hypothesis).slope(self.theta)
        deviation = np.sqrt(np.diag(self.covariance)) * np.abs(slope)
        return dict(zip(self.hypothesis.free, deviation.tolist(), strict=True))


def evaluate(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise, keep: bool = False
) -> Fit:
    """The hypothesis at theta, with score and normal matrix."""
    coordinates = Coordinates(hypothesis)
    p, dp, sensors = coordinates.filter_inputs(theta)
    result = run_filter(experiment, coordinates.stepper, p, dp, sensors, noise, keep)
    objective = float(result.log_likelihood.sum()) - 0.5 * float(
        np.sum((theta / coordinates.prior) ** 2)
    )
    normal = result.normal.sum(0) + np.diag(1.0 / coordinates.prior**2)
    robot = coordinates.robot(theta)
    return Fit(hypothesis, theta, robot, noise, result.log_likelihood, objective, result, normal)


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
    coordinates = Coordinates(start.hypothesis)
    best, noise = start, start.noise
    damping, small = 1e-3, 0
    free = np.flatnonzero(np.ones(len(best.theta), bool) if moving is None else moving)
    for _ in range(iterations):
        gradient = (best.result.gradient.sum(0) + best.theta / coordinates.prior**2)[free]
        normal = best.normal[np.ix_(free, free)]
        damped = normal + damping * np.diag(np.diag(normal))
        move = np.zeros(len(best.theta))
        move[free] = np.clip(-np.linalg.solve(damped, gradient), -LARGEST_STEP, LARGEST_STEP)
        trial = evaluate(start.hypothesis, coordinates.clip(best.theta + move), experiment, noise)
        gain = trial.objective - best.objective
        if np.isfinite(gain) and gain > 0:
            best, damping = trial, max(damping / 10.0, 1e-9)
            small = small + 1 if gain < small_gain else 0
        else:
            damping *= 10.0
            small += np.isfinite(gain) and gain > -small_gain
        if small >= 1 or damping > 1e4:
            break
    return best


def likelihoods(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noises: Sequence[Noise]
) -> Array:
    """(len(noises),) log likelihood of all trials under each noise; -inf where the filter diverges.

    Without derivatives, half the work of `evaluate`.
    """
    coordinates = Coordinates(hypothesis)
    p, _, sensors = coordinates.filter_inputs(theta)
    plain = replace(sensors, free={}, slope={})
    problem = Problem(experiment, coordinates.stepper, p, np.zeros((0, len(p))), plain)
    results = run_filters(problem, noises)
    totals = np.array([result.log_likelihood.sum() for result in results])
    return np.where(np.isfinite(totals), totals, -np.inf)


def log_posterior(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise
) -> float:
    """Log likelihood of all trials plus log prior of theta; -inf where the filter diverges."""
    total = float(likelihoods(hypothesis, theta, experiment, [noise])[0])
    return total - 0.5 * float(np.sum((theta / Coordinates(hypothesis).prior) ** 2))
