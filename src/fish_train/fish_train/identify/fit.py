"""Fit a hypothesis: Levenberg-Marquardt on the innovations' likelihood; estimate the noise.

`tempering` puts the two together to a fit that converges from afar.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_train.identify.encoder import encoder_noise
from fish_train.identify.experiment import Experiment
from fish_train.identify.filter import run_filter
from fish_train.identify.filter_types import ENCODER_ROW, FilterResult, Noise
from fish_train.identify.hypothesis import Coordinates, Hypothesis
from fish_train.identify.sensor_noise import usual_noise

Array = NDArray[np.float64]
NoiseMove = Callable[[Noise, float], Noise]

LARGEST_STEP = 0.5  # of theta in one iteration
SETTLED_GAIN = 3.0  # nats; a round of noise and parameters that gains less is the last
LARGE_GAIN = 100.0  # nats; a round that gains less leaves the noise near its best
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


def settle(fit: Fit, experiment: Experiment, rounds: int = 5, iterations: int = 6) -> Fit:
    """Parameters and process noise in turn, from a fit that was evaluated on this experiment, until neither helps."""
    fit, gain = climb(fit, experiment, iterations), np.inf
    for _ in range(rounds):
        before = fit.objective
        noise = adapt_noise(fit, experiment, near=gain < LARGE_GAIN)
        fit = evaluate(fit.hypothesis, fit.theta, experiment, noise)
        if fit.objective - before < SETTLED_GAIN:
            break
        fit = climb(fit, experiment, iterations)
        gain = fit.objective - before
    return fit


def evaluate(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise, keep: bool = False
) -> Fit:
    """The hypothesis at theta, with score and normal matrix."""
    coordinates = Coordinates(hypothesis)
    p, dp, sensors = coordinates.filter_inputs(theta)
    result = run_filter(experiment, coordinates.stepper, p, dp, sensors, noise, keep)
    objective = float(result.log_likelihood.sum()) - 0.5 * float(np.sum((theta / coordinates.prior) ** 2))
    normal = result.normal.sum(0) + np.diag(1.0 / coordinates.prior**2)
    robot = coordinates.robot(theta)
    return Fit(hypothesis, theta, robot, noise, result.log_likelihood, objective, result, normal)


def climb(start: Fit, experiment: Experiment, iterations: int, small_gain: float = SMALL_GAIN) -> Fit:
    """Levenberg-Marquardt with fixed noise from a fit that was evaluated on this experiment, until it gains little."""
    coordinates = Coordinates(start.hypothesis)
    best, noise = start, start.noise
    damping, small = 1e-3, 0
    for _ in range(iterations):
        gradient = best.result.gradient.sum(0) + best.theta / coordinates.prior**2
        damped = best.normal + damping * np.diag(np.diag(best.normal))
        move = np.clip(-np.linalg.solve(damped, gradient), -LARGEST_STEP, LARGEST_STEP)
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


def trial_likelihoods(
    hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise
) -> FilterResult:
    """A pass without derivatives, half the work of `evaluate`."""
    coordinates = Coordinates(hypothesis)
    p, _, sensors = coordinates.filter_inputs(theta)
    plain = replace(sensors, free={}, slope={})
    return run_filter(experiment, coordinates.stepper, p, np.zeros((0, len(p))), plain, noise)


def log_posterior(hypothesis: Hypothesis, theta: Array, experiment: Experiment, noise: Noise) -> float:
    """Log likelihood of all trials plus log prior of theta; -inf where the filter diverges."""
    total = float(trial_likelihoods(hypothesis, theta, experiment, noise).log_likelihood.sum())
    return (
        total - 0.5 * float(np.sum((theta / Coordinates(hypothesis).prior) ** 2))
        if np.isfinite(total)
        else -np.inf
    )


def likelihood(fit: Fit, experiment: Experiment, noise: Noise) -> float:
    """Log likelihood at a fit's parameters under other noise; -inf where the filter diverges."""
    total = float(trial_likelihoods(fit.hypothesis, fit.theta, experiment, noise).log_likelihood.sum())
    return total if np.isfinite(total) else -np.inf


def _stronger(noise: Noise, factor: float) -> Noise:
    x, y, n = noise.wrench
    return replace(noise, wrench=(factor * x, factor * y, factor * n))


def _wrench(index: int) -> NoiseMove:
    def change(noise: Noise, factor: float) -> Noise:
        x, y, n = (w * (factor if i == index else 1.0) for i, w in enumerate(noise.wrench))
        return replace(noise, wrench=(x, y, n))

    return change


def _field(name: str) -> NoiseMove:
    def change(noise: Noise, factor: float) -> Noise:
        return replace(noise, **{name: getattr(noise, name) * factor})

    return change


SHORTEST_WRENCH, LONGEST_WRENCH = 0.02, 5.0  # s; a step of the filter is 0.01 s
JUMPS = (0.25, 4.0)  # of the wrench's standard deviations
LADDER, TIMES = (
    (4.0, 16.0, 64.0),
    (0.2, 2.0),
)  # times usual water's, and s: a missing force is strong, and fast or slow
NOISE_MOVES = (*(_wrench(i) for i in range(3)), _field("wrench_time"))
SENSOR_MOVES = tuple(map(_field, ("gyro", "accel", "camera_position", "camera_heading")))


def adapt_noise(
    fit: Fit,
    experiment: Experiment,
    rounds: int = 1,
    moves: Sequence[NoiseMove] = NOISE_MOVES,
    near: bool = False,
) -> Noise:
    """Maximum-likelihood wrench intensities and their time constant: parabola through three points each, in turn.

    The encoder's noise is that of what the fit leaves of it.

    The start is the best of a few far apart, unless it is known to be `near`: a model that has just found its missing
    effect needs far less noise than the one before, and from there the parabola stops half-way.
    """
    residual = fit.noise.encoder * fit.result.whitened[..., ENCODER_ROW]
    old = replace(fit.noise, encoder=encoder_noise(residual, Noise().encoder))
    usual = replace(
        usual_noise(experiment),
        gate_camera=old.gate_camera,
        gate_imu=old.gate_imu,
        encoder=old.encoder,
    )  # of the sensors too
    starts = [old]
    if not near:
        starts += [usual, replace(old, wrench=usual.wrench, wrench_time=usual.wrench_time)]
        starts += [_stronger(old, f) for f in JUMPS]
        starts += [replace(_stronger(usual, f), wrench_time=t) for f in LADDER for t in TIMES]
    noise, best = max(((n, likelihood(fit, experiment, n)) for n in starts), key=lambda found: found[1])
    for _ in range(rounds):
        for change in moves:
            low, high = (likelihood(fit, experiment, change(noise, f)) for f in (0.5, 2.0))
            curvature, slope = low + high - 2.0 * best, 0.5 * (high - low)
            parabola = np.isfinite(curvature) and curvature < 0
            octaves = -slope / curvature if parabola else np.sign(np.nan_to_num(slope)) * 2.0
            candidate = change(noise, 2.0 ** float(np.clip(octaves, -2.0, 2.0)))
            if not SHORTEST_WRENCH <= candidate.wrench_time <= LONGEST_WRENCH:
                continue
            value = likelihood(fit, experiment, candidate)
            if value > best:
                noise, best = candidate, value
    return noise
