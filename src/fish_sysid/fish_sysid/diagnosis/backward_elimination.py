# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Backward elimination: what of a grown model is superfluous, or was taken for something else, now that all of it is there.

An effect that was added while another one was missing has competed to explain what that one does as well.
"""

from __future__ import annotations

from dataclasses import replace

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.result import Accepted
from fish_sysid.diagnosis.screening import best_start
from fish_sysid.diagnosis.significance import (
    look_alike,
    parameter_count,
    probabilities,
    simplest,
)
from fish_sysid.diagnosis.task import Task
from fish_sysid.estimation.map_fit import Fit, estimate_noise, evaluate
from fish_sysid.estimation.refit import refit
from fish_sysid.estimation.thresholds import PLAUSIBLE


def eliminate(
    final: Fit, accepted: tuple[Accepted, ...], task: Task
) -> tuple[Fit, tuple[Accepted, ...]]:
    """Every effect but the last tested again, without it and against its rivals, in the final model."""
    training, kept = task.trials.training, list(accepted[-1:])
    for candidate in accepted[:-1]:
        task.progress(f"without {candidate.name}?")
        start = without(final, candidate.name, training)
        less = refit(start.hypothesis, start.theta, training, start.noise)
        count = task.parameter_count(candidate.name)
        if final.log_posterior - less.log_posterior < task.level.needed(final.samples, count, 1):
            final = less
            continue
        best = contested(candidate, final, task)
        final = best.contest[best.name]
        kept.insert(-1, best)
    return final, tuple(kept)


def contested(candidate: Accepted, final: Fit, task: Task) -> Accepted:
    """An effect, or the simpler look-alike that does as well, with its rivals refitted in its place of the final model."""
    name, fits = candidate.name, {candidate.name: final}
    for other in rivals(candidate, final):
        task.progress(f"{other} instead of {name}?")
        fits[other] = exchanged(final, name, other, task.trials.training)
    return replace(candidate, name=simplest(name, fits, task.level), contest=fits)


def rivals(candidate: Accepted, final: Fit) -> list[str]:
    """Names that competed in an effect's round, are not in the final model, and were plausible or are simpler look-alikes."""
    name, contest = candidate.name, candidate.contest
    others = set(final.hypothesis.names) - {name}
    plausible = probabilities({n: fit for n, fit in contest.items() if n not in others})

    def simpler(other: str) -> bool:
        fewer = parameter_count(contest[other], other) < parameter_count(contest[name], name)
        return look_alike(other, name) and fewer

    return [n for n, p in plausible.items() if n != name and (p > PLAUSIBLE or simpler(n))]


def exchanged(fit: Fit, name: str, other: str, experiment: Experiment) -> Fit:
    """The fit with another effect in the place of one of its own, refitted."""
    less = switched_off(fit, name, experiment)
    hypothesis = less.hypothesis.with_effect(other)
    theta = best_start(hypothesis, less, other, experiment, fit.noise)
    return refit(hypothesis, theta, experiment, fit.noise)


def without(fit: Fit, name: str, experiment: Experiment) -> Fit:
    """The fit less one effect with the noise that it then needs, its other parameters as they are."""
    less = switched_off(fit, name, experiment)
    return evaluate(less.hypothesis, less.theta, experiment, estimate_noise(less, experiment))


def switched_off(fit: Fit, name: str, experiment: Experiment) -> Fit:
    """The fit less one effect, its other parameters as they are."""
    smaller = fit.hypothesis.without(name)
    return evaluate(smaller, fit.theta[~fit.hypothesis.own(name)], experiment, fit.noise)
