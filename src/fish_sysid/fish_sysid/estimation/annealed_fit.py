# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Annealed fit: the IMU's noise is inflated at first, so that the camera decides, and lowered stage by stage.

With the full weight of accelerometer and gyro the likelihood has many optima, because a wrong phase of the tail's swing is as
bad as no swing at all. With their standard deviations a hundred times as large, the nominal values lead to the optimum from
30 % away where the tail has few links. Every stage starts from the one before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit, climb, evaluate, log_posterior
from fish_sysid.estimation.noise_estimation import (
    NOISE_MOVES,
    SENSOR_MOVES,
    Reach,
    estimate_noise,
)
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.thresholds import (
    COARSE_GAIN,
    FINAL_ITERATIONS,
    IMU_STAGES,
    INNOVATION_RMS_REJECT,
    NOISE_ROUND_ITERATIONS,
    NOISE_ROUNDS,
)

Report = Callable[[str], None]
Stages = tuple[tuple[float, int], ...]  # factor of the IMU's noise, most iterations


def annealed_fit(
    hypothesis: Hypothesis,
    starts: Sequence[Array],
    experiment: Experiment,
    noise: Noise,
    stages: Stages,
    held: tuple[str, ...] = (),
    report: Report = lambda _: None,
) -> Fit:
    """From the start (K,) whose annealing ends best to the IMU's full weight, then process noise and parameters in turn.

    held: parameters that stay at the start until the IMU's full weight.
    """
    report("fitting, the camera decides")
    ends = on_all_cores(
        lambda start: anneal(hypothesis, start, experiment, noise, stages, held), starts
    )
    best = max(ends, key=lambda fit: fit.log_posterior)
    return at_full_weight(best, experiment, noise, held, report)


def anneal(
    hypothesis: Hypothesis,
    theta: Array,
    experiment: Experiment,
    noise: Noise,
    stages: Stages,
    held: Sequence[str] = (),
) -> Fit:
    """The optimum of the last stage from theta (K,), without gates.

    The stages end early where no noise of the sensors explains what is left.
    """
    theta = theta.copy()
    moving = [i for i, name in enumerate(hypothesis.free) if name not in held]
    reduced = hypothesis.fixing(held, theta) if held else hypothesis
    for factor, iterations in stages:
        inflated = noise.with_imu(factor)
        start = evaluate(reduced, theta[moving], experiment, inflated)
        fit = climb(start, experiment, iterations, COARSE_GAIN)
        theta[moving] = fit.theta
        if fit.max_innovation_rms > INNOVATION_RMS_REJECT:
            break
    return evaluate(hypothesis, theta, experiment, inflated) if held else fit


def at_full_weight(
    fit: Fit,
    experiment: Experiment,
    noise: Noise,
    held: tuple[str, ...] = (),
    report: Report = lambda _: None,
) -> Fit:
    """From the camera's optimum to the IMU's full weight, then process noise and parameters in turn.

    Where a stage leaves innovations that the sensors' noise does not explain, either this noise or the model is wrong: the
    noise is estimated as well and kept, and the likelier of the two fits is returned. The last iterations use the gates of
    `noise`.
    """
    hypothesis = fit.hypothesis
    if fit.max_innovation_rms <= INNOVATION_RMS_REJECT:
        report("fitting, the IMU gains weight")
        fit = anneal(hypothesis, fit.theta, experiment, noise, IMU_STAGES, held)
    fits = []
    if fit.max_innovation_rms > INNOVATION_RMS_REJECT:
        fits = [_with_sensor_noise(fit, experiment, report)]
    fit = climb(evaluate(hypothesis, fit.theta, experiment, noise), experiment, FINAL_ITERATIONS)
    for _ in range(NOISE_ROUNDS):
        report("fitting, process noise")
        found = estimate_noise(fit, experiment, reach=Reach.ANYWHERE)
        found = replace(found, gate_camera=noise.gate_camera, gate_imu=noise.gate_imu)
        start = evaluate(hypothesis, fit.theta, experiment, found)
        fit = climb(start, experiment, NOISE_ROUND_ITERATIONS)

    def without_gates(one: Fit) -> float:
        """Gates would leave out what speaks against a filter that has lost the fish."""
        return log_posterior(hypothesis, one.theta, experiment, one.noise.ungated())

    return max((fit, *fits), key=without_gates) if fits else fit


def _with_sensor_noise(fit: Fit, experiment: Experiment, report: Report) -> Fit:
    """Noise of sensors and process, and parameters, in turn, without gates."""
    for _ in range(NOISE_ROUNDS + 1):
        report("fitting, noise of sensors and process")
        moves = (*SENSOR_MOVES, *NOISE_MOVES)
        noise = estimate_noise(fit, experiment, 2, moves, Reach.ANYWHERE)
        start = evaluate(fit.hypothesis, fit.theta, experiment, noise)
        fit = climb(start, experiment, NOISE_ROUND_ITERATIONS)
    return fit
