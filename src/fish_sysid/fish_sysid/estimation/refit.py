# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A refit with a schedule, and a global fit where no single start leads to the best optimum from everywhere.

A refit anneals, if its schedule says so, then takes noise and parameters in turn. Mass and grip of the tail have many optima, the
more the more links it has. Where the camera decides they lie close together, so that many short annealings (multistart, then
basin hopping: Wales and Doye 1997; as many of each as there are pairs of links) cost less than one to the end. The best goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from math import comb

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.estimation.annealed_fit import Report, Stages, anneal, annealed_fit, at_full_weight
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit, better, climb, evaluate
from fish_sysid.estimation.noise_estimation import Reach, estimate_noise
from fish_sysid.estimation.parametrization import Hypothesis
from fish_sysid.estimation.thresholds import (
    CAMERA_STAGES,
    FAR_NOISE_GAIN,
    FEW_LINKS,
    FIRST_STEPS,
    HELD_AT,
    HOP_SPREAD,
    INNOVATION_RMS_SUSPECT,
    NOISE_GAIN,
    RATIO_SUSPECT,
    ROUND_ITERATIONS,
    ROUNDS,
    ROUNDS_IF_SUSPECT,
    START_SPREAD,
    TAIL_INERTIAS,
)


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
        large = hypothesis.large if schedule.hold_large else ()
        fit = _annealed(hypothesis, theta, experiment, noise, schedule, large, report)
    suspect = fit.largest_ratio > RATIO_SUSPECT
    rounds = schedule.rounds_if_suspect if suspect else schedule.rounds
    return alternate(fit, experiment, rounds) if rounds else fit


def _annealed(
    hypothesis: Hypothesis,
    theta: Array,
    experiment: Experiment,
    noise: Noise,
    schedule: Schedule,
    large: tuple[str, ...],
    report: Report,
) -> Fit:
    """Annealed in all but the parameters of large effects, which keep their values."""
    reduced = hypothesis.fixing(large, theta) if large else hypothesis
    moving = np.array([free not in large for free in hypothesis.free], dtype=bool)
    held = tuple(name for name in schedule.held if name in reduced.free)
    index = np.isin(reduced.free, held) if held else np.zeros(int(moving.sum()), dtype=bool)
    starts = [theta[moving] + value * index for value in (HELD_AT if held else HELD_AT[:1])]
    fit = annealed_fit(reduced, starts, experiment, noise, schedule.stages, held, report)
    if not large:
        return fit
    theta = theta.copy()
    theta[moving] = fit.theta
    return evaluate(hypothesis, theta, experiment, fit.noise)


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


def best_of_restart(
    fit: Fit, theta: Array, experiment: Experiment, noise: Noise, schedule: Schedule
) -> Fit:
    """The fit, or the optimum that a schedule reaches from another theta.

    The other one is refitted on whole trials only where it is ahead on shortened ones, on which both are refitted.
    """
    hypothesis, short = fit.hypothesis, shorten(experiment, FIRST_STEPS)
    other = refit(hypothesis, theta, short, noise, schedule)
    here = refit(hypothesis, fit.theta, short, fit.noise)
    if other.log_posterior - here.log_posterior < NOISE_GAIN:
        return fit
    return better(fit, refit(hypothesis, other.theta, experiment, other.noise))


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
