# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Screening: how many nats every candidate gains, quickly, on short trials.

The local screening adds each candidate to the base at the base's noise, which is inflated by what the model lacks. Where the
base needs little process noise, one Gauss-Newton step tells the gain. Elsewhere the IMU's noise is inflated at first, where
the likelihood has few optima, and each candidate starts from the base and from the nominal values, weak and strong: a
structural effect may be absorbed so deeply that no path leads from the base to the truth.

The annealed screening is for a base that is so far from the truth that no path leads there from it, and whose noise hides
the right name. All candidates start at the nominal values with the noise of usual water, annealed: only the right name leaves
little then.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.result import Screened
from fish_sysid.diagnosis.task import Task
from fish_sysid.estimation.ekf import prepare
from fish_sysid.estimation.ekf_types import Array, Noise
from fish_sysid.estimation.map_fit import Fit, climb, evaluate, log_posterior
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import Hypothesis, extend
from fish_sysid.estimation.refit import Stages, anneal
from fish_sysid.estimation.thresholds import (
    POLISH_ITERATIONS,
    POLISHED,
    PROMISING_PLACES,
    RATIO_SUSPECT,
    SCREENING_IMU_FACTOR,
    SCREENING_ITERATIONS,
    SCREENING_STAGES,
    START_STRENGTH,
    STRENGTH_ITERATIONS,
    STRENGTHS,
    WEAK_STRENGTHS,
)


@dataclass(frozen=True)
class Method:
    """One way to screen."""

    base: Fit  # to which candidates are added
    place: Callable[[Fit, str], Fit]  # a candidate's first fit, on the base with large effects held
    promise: Callable[[Fit], float]  # the promising ones are polished
    polish: Callable[[Fit, bool], Fit]  # with whether it is promising
    reference: float  # log posterior of the base alone, reached in the same way


def screen(
    base: Fit, names: Sequence[str], task: Task, annealed: bool = False
) -> tuple[Screened, ...]:
    """All candidates added to the base one at a time, what gains most first; the most promising are fitted further.

    An effect with very many parameters in the base is held while candidates are screened and free afterwards, so that what it
    absorbs of a candidate is in the candidate's gain.
    """
    short = task.trials.short
    method = _annealed(base, short) if annealed else _local(base, short, task)
    task.progress("compiling what is not in the cache yet")
    on_all_cores(lambda name: prepare(base.hypothesis.with_effect(name).robot), names)
    held = hold_large(method.base, short)

    def one(index: int) -> Fit:
        name = names[index]
        task.progress(f"screening {name} ({index + 1} of {len(names)})")
        return release_large(method.place(held, name), method.base, name, short)

    fits = dict(zip(names, on_all_cores(one, range(len(names))), strict=True))
    task.progress("screening the most promising")
    promising = sorted(names, key=lambda name: -method.promise(fits[name]))[:POLISHED]
    ends = on_all_cores(lambda name: method.polish(fits[name], name in promising), names)
    found = [
        Screened(n, fit.log_posterior - method.reference, fit.theta)
        for n, fit in zip(names, ends, strict=True)
    ]
    return tuple(sorted(found, key=lambda one: -one.gain))


def _local(base: Fit, short: Experiment, task: Task) -> Method:
    """Around the base, at its noise."""
    start = evaluate(base.hypothesis, base.theta, short, base.noise)
    reference = climb(start, short, POLISH_ITERATIONS)
    near = base.largest_ratio < RATIO_SUSPECT
    far = partial(place_far, short=short, task=task)

    def polish(fit: Fit, promising: bool) -> Fit:
        return climb(fit, short, POLISH_ITERATIONS) if promising else fit

    return Method(
        reference if near else base,
        partial(place_near, short=short) if near else far,
        promise,
        polish,
        reference.log_posterior,
    )


def _annealed(base: Fit, short: Experiment) -> Method:
    """From the nominal values, annealed at the noise of usual water; compared at the noise of the last stage."""
    noise = usual_noise(short)

    def further(fit: Fit, stages: Stages) -> Fit:
        theta = (
            anneal(fit.hypothesis, fit.theta, short, noise, stages).theta if stages else fit.theta
        )
        last = noise.with_imu(SCREENING_STAGES[-1][0])
        return evaluate(fit.hypothesis, theta, short, last)

    starts = (base, from_nominal(base))
    bases = on_all_cores(lambda fit: further(fit, SCREENING_STAGES), starts)
    return Method(
        base,
        partial(place_annealed, short=short, noise=noise),
        lambda fit: fit.log_posterior,
        lambda fit, promising: further(fit, SCREENING_STAGES[1:] if promising else ()),
        max(fit.log_posterior for fit in bases),
    )


def place_near(base: Fit, name: str, short: Experiment) -> Fit:
    """A candidate on a base that leaves no more than water: what is missing is small, so one step tells its gain."""
    hypothesis = base.hypothesis.with_effect(name)
    fits = [
        fit_strength(evaluate(hypothesis, theta, short, base.noise), name, short)
        for theta in starts_of(base, name, short, base.noise, WEAK_STRENGTHS)
    ]
    return max(fits, key=promise)


def place_far(base: Fit, name: str, short: Experiment, task: Task | None = None) -> Fit:
    """A candidate on a base far from the truth: from the best of all starts, with the IMU's noise inflated at first.

    task: whose stage `nominal start` may be off, and is told when a start at the nominal values is the best.
    """
    inflated = base.noise.with_imu(SCREENING_IMU_FACTOR)
    hypothesis = base.hypothesis.with_effect(name)
    theta = best_start(hypothesis, base, name, short, inflated)
    if task is None or task.runs("nominal start"):
        other = best_start(hypothesis, from_nominal(base), name, short, inflated)
        better = likeliest(hypothesis, [theta, other], short, inflated)
        theta = better if task is None else task.kept("nominal start", theta, better)
    fit = fit_strength(evaluate(hypothesis, theta, short, inflated), name, short)
    return evaluate(hypothesis, climb(fit, short, SCREENING_ITERATIONS).theta, short, base.noise)


def place_annealed(base: Fit, name: str, short: Experiment, noise: Noise) -> Fit:
    """A candidate from the nominal values, strong or weak, after the first stage of the annealing."""
    hypothesis = base.hypothesis.with_effect(name)
    inflated = noise.with_imu(SCREENING_STAGES[0][0])
    theta = best_start(hypothesis, from_nominal(base), name, short, inflated)
    return anneal(hypothesis, theta, short, noise, SCREENING_STAGES[:1])


def from_nominal(base: Fit) -> Fit:
    """The base at the nominal values, its effects as they are; only `theta` is moved."""
    return replace(base, theta=base.hypothesis.parametrization.at_nominal(base.theta))


def best_start(
    hypothesis: Hypothesis, base: Fit, name: str, experiment: Experiment, noise: Noise
) -> Array:
    """Theta (K,) of the likeliest start of a candidate on a base."""
    return likeliest(hypothesis, starts_of(base, name, experiment, noise), experiment, noise)


def likeliest(
    hypothesis: Hypothesis, starts: Sequence[Array], experiment: Experiment, noise: Noise
) -> Array:
    """The theta (K,) with the largest log posterior, the first of equal ones."""
    return max(starts, key=lambda theta: log_posterior(hypothesis, theta, experiment, noise))


def starts_of(
    base: Fit,
    name: str,
    experiment: Experiment,
    noise: Noise,
    strengths: Sequence[float] = STRENGTHS,
) -> list[Array]:
    """theta (K,) of the base with a candidate at its best place, weak and strong where this leaves its strength open."""
    place = best_place(base, name, experiment, noise)
    if place.keys() >= set(base.hypothesis.effect(name).strength):  # the place determines it
        strengths = strengths[:1]
    return [started(base, name, strength, place) for strength in strengths]


def started(base: Fit, name: str, strength: float, place: Mapping[str, float]) -> Array:
    """theta (K,) of the base with a candidate of this strength, in typical ones, at this place."""
    return extend(base.theta, base.hypothesis.with_effect(name), name, strength, place)


def best_place(base: Fit, name: str, experiment: Experiment, noise: Noise) -> dict[str, float]:
    """Values of the parameters that say where or how fast, of those to be tried, from which the effect gains most.

    The few that promise most are fitted in their strength: far from the base a promise is rough. A place where the effect
    does nothing is left out: no step leads from there to one where it acts.
    """
    hypothesis = base.hypothesis.with_effect(name)
    parameters = hypothesis.effect(name).parameters
    tries = {key: parameter.tries for key, parameter in parameters.items() if parameter.tries}
    places = [dict(zip(tries, values, strict=True)) for values in product(*tries.values())]
    if len(places) == 1:
        return places[0]
    fits = [
        evaluate(hypothesis, started(base, name, START_STRENGTH, p), experiment, noise)
        for p in places
    ]
    acting = [i for i, fit in enumerate(fits) if acts(fit, name)] or range(len(places))
    promising = sorted(acting, key=lambda i: -promise(fits[i]))[:PROMISING_PLACES]
    best = max(promising, key=lambda i: fit_strength(fits[i], name, experiment).log_posterior)
    return places[best]


def acts(fit: Fit, name: str) -> bool:
    """Whether an effect of the fit changes anything: a limit that no command reaches does not, nor a slack line."""
    return bool(np.diagonal(fit.result.normal.sum(0))[fit.hypothesis.own(name)].any())


def fit_strength(fit: Fit, name: str, short: Experiment) -> Fit:
    """A candidate that has a place, fitted in all but this: while an effect is weak its place seems free, and a step loses it.

    Separable least squares (Golub and Pereyra 1973): in its strength a fit is nearly linear.
    """
    parameters = fit.hypothesis.effect(name).parameters
    places = {f"{name}.{key}" for key, parameter in parameters.items() if parameter.tries}
    moving = np.array([free not in places for free in fit.hypothesis.free])
    return fit if moving.all() else climb(fit, short, STRENGTH_ITERATIONS, moving=moving)


def promise(fit: Fit) -> float:
    """Log posterior that one Gauss-Newton step would reach, were the problem quadratic."""
    if not np.isfinite(fit.log_posterior):
        return -np.inf
    step = np.linalg.solve(fit.information, fit.gradient)
    return fit.log_posterior + 0.5 * float(fit.gradient @ step)


def hold_large(base: Fit, experiment: Experiment) -> Fit:
    """The base with its large effects fixed: a pass with derivatives for their parameters takes several times as long."""
    held = base.hypothesis.large
    if not held:
        return base
    moving = np.array([free not in held for free in base.hypothesis.free])
    reduced = base.hypothesis.fixing(held, base.theta)
    return evaluate(reduced, base.theta[moving], experiment, base.noise)


def release_large(fit: Fit, base: Fit, name: str, experiment: Experiment) -> Fit:
    """A candidate that was fitted on the base of `hold_large`, with everything free."""
    if not base.hypothesis.large:
        return fit
    hypothesis = base.hypothesis.with_effect(name)
    theta = dict(zip(base.hypothesis.free, base.theta, strict=True))
    theta |= zip(fit.hypothesis.free, fit.theta, strict=True)
    everything = np.array([theta[free] for free in hypothesis.free])
    return evaluate(hypothesis, everything, experiment, fit.noise)
