# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A refit with a schedule, and a global fit where no single start leads to the best optimum from everywhere.

A refit anneals, if its schedule says so, then takes noise and parameters in turn. Annealing inflates the IMU's noise at first,
so that the camera decides, and lowers it stage by stage, each from the optimum of the one before. With the full weight of
accelerometer and gyro the likelihood has many optima, because a wrong phase of the tail's swing is as bad as no swing at all.
With their standard deviations a hundred times as large, the nominal values lead to the optimum from 30 % away where the tail has
few links.

Mass and grip of the tail have many optima, the more the more links it has. Where the camera decides they lie close together, so
that many short annealings (multistart, then basin hopping: Wales and Doye 1997; as many of each as there are pairs of links) cost
less than one to the end. The best goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import comb

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import (
    NOISE_MOVES,
    SENSOR_MOVES,
    Fit,
    Reach,
    better,
    climb,
    estimate_noise,
    evaluate,
    log_posterior,
)
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.thresholds import (
    CAMERA_STAGES,
    COARSE_GAIN,
    FAR_NOISE_GAIN,
    FEW_LINKS,
    FINAL_ITERATIONS,
    FIRST_STEPS,
    HELD_AT,
    HOP_SPREAD,
    IMU_STAGES,
    INNOVATION_RMS_REJECT,
    INNOVATION_RMS_SUSPECT,
    NOISE_GAIN,
    NOISE_ROUND_ITERATIONS,
    NOISE_ROUNDS,
    RATIO_SUSPECT,
    ROUND_ITERATIONS,
    ROUNDS,
    ROUNDS_IF_SUSPECT,
    START_SPREAD,
    TAIL_INERTIAS,
)

Report = Callable[[str], None]
Stages = tuple[tuple[float, int], ...]  # factor of the IMU's noise, most iterations


@dataclass(frozen=True)
class Schedule:
    """How a refit goes from its start to an optimum."""

    stages: Stages = ()  # of the annealing, () for none
    held: tuple[str, ...] = ()  # parameters held while annealing, tried at HELD_AT
    hold_large: bool = False  # effects of more than LARGE_EFFECT parameters held until the end
    steps: int | None = None  # grid points of each trial; None: whole trials
    rounds: int = 0  # of noise estimation and refit at the end
    rounds_if_suspect: int = 0  # where the start needs the process noise of a wrong model


REFIT = Schedule(rounds=ROUNDS, rounds_if_suspect=ROUNDS)
CONTINUE = Schedule(rounds=ROUNDS, rounds_if_suspect=ROUNDS_IF_SUSPECT)
ANNEAL = Schedule(CAMERA_STAGES)
ANNEAL_HELD = Schedule(CAMERA_STAGES, TAIL_INERTIAS)
ANNEAL_SHORT_HELD = Schedule(CAMERA_STAGES, TAIL_INERTIAS, True, FIRST_STEPS)
ANNEAL_NEAR = Schedule(CAMERA_STAGES[-1:], rounds=ROUNDS, rounds_if_suspect=ROUNDS)


def refit(
    hypothesis: Hypothesis,
    theta: Array,
    experiment: Experiment,
    noise: Noise,
    schedule: Schedule = CONTINUE,
    report: Report = lambda _: None,
) -> Fit:
    """The optimum that a schedule reaches from theta (K,) and noise."""
    if schedule.steps is not None:
        experiment = shorten(experiment, schedule.steps)
    if not schedule.stages:
        fit = evaluate(hypothesis, theta, experiment, noise)
    else:
        fit = _annealed(hypothesis, theta, experiment, noise, schedule, report)
    suspect = fit.largest_ratio > RATIO_SUSPECT
    rounds = schedule.rounds_if_suspect if suspect else schedule.rounds
    return alternate(fit, experiment, rounds) if rounds else fit


def _annealed(
    hypothesis: Hypothesis,
    theta: Array,
    experiment: Experiment,
    noise: Noise,
    schedule: Schedule,
    report: Report,
) -> Fit:
    """From the start whose annealing ends best to the IMU's full weight; parameters of large effects may keep their values."""
    large = hypothesis.large if schedule.hold_large else ()
    reduced = hypothesis.fixing(large, theta) if large else hypothesis
    moving = np.array([free not in large for free in hypothesis.free], dtype=bool)
    held = tuple(name for name in schedule.held if name in reduced.free)
    index = np.isin(reduced.free, held) if held else np.zeros(int(moving.sum()), dtype=bool)
    starts = [theta[moving] + value * index for value in (HELD_AT if held else HELD_AT[:1])]
    report("fitting, the camera decides")
    ends = on_all_cores(
        lambda start: anneal(reduced, start, experiment, noise, schedule.stages, held), starts
    )
    best = max(ends, key=lambda fit: fit.log_posterior)
    fit = at_full_weight(best, experiment, noise, held, report)
    if not large:
        return fit
    theta = theta.copy()
    theta[moving] = fit.theta
    return evaluate(hypothesis, theta, experiment, fit.noise)


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


def alternate(fit: Fit, experiment: Experiment, rounds: int = ROUNDS) -> Fit:
    """Parameters and process noise in turn, from a fit that was evaluated on this experiment, until neither helps."""
    fit, gain = climb(fit, experiment, ROUND_ITERATIONS), np.inf
    for _ in range(rounds):
        before, reach = fit.log_posterior, Reach.NEAR if gain < FAR_NOISE_GAIN else Reach.FAR
        noise = estimate_noise(fit, experiment, reach=reach)
        fit = evaluate(fit.hypothesis, fit.theta, experiment, noise)
        if fit.log_posterior - before < NOISE_GAIN:
            break
        fit = climb(fit, experiment, ROUND_ITERATIONS)
        gain = fit.log_posterior - before
    return fit


def refit_on(fit: Fit, experiment: Experiment) -> Fit:
    """A fit of some trials refitted on others."""
    return refit(fit.hypothesis, fit.theta, experiment, fit.noise)


def global_fit(hypothesis: Hypothesis, experiment: Experiment, noise: Noise) -> Fit:
    """The best of many optima.

    Where much is missing or the tail has many links, optima of the camera tell little of those at the IMU's full weight:
    there an annealing with the tail's inertias held competes.
    """
    fit = refit_if_suspect(multistart_fit(hypothesis, experiment, noise), experiment)
    right = fit.largest_ratio < RATIO_SUSPECT and fit.max_innovation_rms <= INNOVATION_RMS_SUSPECT
    if right and hypothesis.robot.links <= FEW_LINKS:
        return fit
    origin = hypothesis.parametrization.origin()
    return better(fit, refit(hypothesis, origin, experiment, noise, ANNEAL_HELD))


def multistart_fit(
    hypothesis: Hypothesis, experiment: Experiment, noise: Noise, places: Sequence[Array] = ()
) -> Fit:
    """Annealed from the best of the optima of many starts on the first seconds; the same at every call.

    places: theta (K,) to start from besides the origin and random ones.
    """
    parametrization, pairs = hypothesis.parametrization, comb(hypothesis.robot.links, 2)
    short = shorten(experiment, FIRST_STEPS)
    origin, random = parametrization.origin(), np.random.default_rng(0)

    def somewhere(count: int) -> Array:
        return parametrization.is_log * random.normal(size=(count, len(origin)))

    starts = [origin, *places, *(origin + START_SPREAD * somewhere(pairs))]
    ends = on_all_cores(
        lambda start: anneal(hypothesis, start, short, noise, CAMERA_STAGES), starts
    )
    best = reduce(better, ends)
    for step in somewhere(pairs):
        start = best.theta + HOP_SPREAD * step
        best = better(best, anneal(hypothesis, start, short, noise, CAMERA_STAGES[1:]))
    return at_full_weight(
        evaluate(hypothesis, best.theta, experiment, best.noise), experiment, noise
    )


def refit_if_suspect(fit: Fit, experiment: Experiment, report: Report = lambda _: None) -> Fit:
    """The fit, or where it needs more process noise than water: refitted, and annealed once more from there."""
    if fit.largest_ratio < RATIO_SUSPECT:
        return fit
    report("fitting, process noise and parameters in turn")
    found = alternate(fit, experiment)
    if found.largest_ratio < RATIO_SUSPECT:
        return found
    report("fitting once more from there")
    again = refit(found.hypothesis, found.theta, experiment, found.noise, ANNEAL, report)
    return better(found, again)
