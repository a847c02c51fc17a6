# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One round of the forward selection: screen all candidates, refit the best and the base itself.

Every hypothesis refits all nominal parameters: an effect counts only for what they cannot absorb.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fish_report.parallel import on_all_cores
from fish_sysid.diagnosis.result import Round, Screened
from fish_sysid.diagnosis.screening import screen
from fish_sysid.diagnosis.significance import look_alike
from fish_sysid.diagnosis.task import Task, Trials
from fish_sysid.estimation.map_fit import Fit, estimate_noise, evaluate, log_posterior
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.refit import (
    ANNEAL_SHORT_HELD,
    REFIT,
    refit,
)
from fish_sysid.estimation.thresholds import (
    ANNEALED_SHORTLIST,
    LARGE_EFFECT,
    MOST_RESTARTS,
    NOISE_GAIN,
    POOR_BASE,
    RATIO_REJECT,
    SHORTLIST,
    WORTH_A_REFIT,
)


def run_round(base: Fit, task: Task) -> Round:
    """Screen and refit, from a base that the best candidate does not lead to a better optimum.

    A base in a poor optimum looks like missing physics, and the best candidate imitates what the better optimum does.
    """
    needed = task.needed(base)
    least = min(needed.values())
    for _ in range(MOST_RESTARTS):
        found = screen_and_refit(base, needed, task)
        if found.best is None or found.gain(found.best) < least or not task.runs("base restart"):
            return found
        best = found.refitted[found.best]
        task.progress("refitting without it, from its optimum")
        restarted = task.kept("base restart", base, restart_base(base, best, task.trials))
        found = replace(found, base=restarted)
        reached = restarted.log_posterior - base.log_posterior
        if reached <= max(POOR_BASE * (best.log_posterior - base.log_posterior), least):
            return found
        base = restarted
    return found


def screen_and_refit(base: Fit, needed: Mapping[str, float], task: Task) -> Round:
    """Screen all names on top of the base and refit the shortlist.

    needed: nats that each name must gain. A base that needs more process noise than any pool is screened by annealing first, and
    locally where that finds nothing.
    """
    far = base.largest_ratio > RATIO_REJECT and task.runs("annealed screening")
    for annealed in (True, False) if far else (False,):
        ranking = screen(base, tuple(needed), task, annealed)
        gains = ", ".join(f"{one.name} {one.gain:.0f}" for one in ranking[:5])
        task.progress(f"first: {gains} nats")
        chosen = [
            one
            for one in shortlist(ranking, task, annealed)
            if worth_a_refit(one, needed[one.name], task)
        ]
        if chosen:
            task.progress("refitting " + ", ".join(one.name for one in chosen))
        fit = refit_annealed if annealed else refit_candidate
        fits = on_all_cores(lambda one: fit(base, one, task), chosen)  # noqa: B023
        found = Round(base, ranking, dict(zip((one.name for one in chosen), fits, strict=True)))
        if found.best is not None and found.gain(found.best) >= min(needed.values()):
            if annealed:
                task.acted.add("annealed screening")
            break
    return found


def shortlist(ranking: Sequence[Screened], task: Task, annealed: bool) -> list[Screened]:
    """The best few and the look-alikes of the very best, as far as they come near it.

    After the annealed screening the best and the next one, as their refit takes long, which has not very many parameters.
    """
    best = ranking[0]
    near = [one for one in ranking if one.gain > WORTH_A_REFIT * best.gain]
    if annealed:
        small = [one for one in near[1:] if task.parameter_count(one.name) <= LARGE_EFFECT]
        return [best, *small][:ANNEALED_SHORTLIST]
    return [one for i, one in enumerate(near) if i < SHORTLIST or look_alike(one.name, best.name)]


def worth_a_refit(one: Screened, needed: float, task: Task) -> bool:
    """Whether a candidate may gain what it needs.

    Half a nat per parameter is subtracted, the mean gain of an effect that is absent (Wilks 1938).
    """
    return one.gain - 0.5 * task.parameter_count(one.name) > WORTH_A_REFIT * needed


def refit_candidate(base: Fit, one: Screened, task: Task) -> Fit:
    """A candidate on whole trials from the optimum of the screening, with noise of its own from the start.

    The base's noise, of sensors as well, includes what the base lacks.
    """
    experiment, hypothesis = task.trials.searched, base.hypothesis.with_effect(one.name)
    start = evaluate(hypothesis, one.theta, experiment, base.noise)
    noise = estimate_noise(start, experiment)
    return refit(hypothesis, one.theta, experiment, noise, REFIT)


def refit_annealed(base: Fit, one: Screened, task: Task) -> Fit:
    """A candidate annealed from the nominal values on shortened trials, then on whole ones: the base's optimum is a poor one."""
    experiment, hypothesis = task.trials.searched, base.hypothesis.with_effect(one.name)
    theta = hypothesis.parametrization.at_nominal(one.theta)
    noise = usual_noise(task.trials.short)
    fit = refit(hypothesis, theta, experiment, noise, ANNEAL_SHORT_HELD)
    return refit(hypothesis, fit.theta, experiment, fit.noise)


def restart_base(base: Fit, rival: Fit, trials: Trials) -> Fit:
    """The base, or the better optimum that a rival's nominal parameters lead to.

    It is sought on whole trials: shorter ones may lead both from the base and from there to one optimum, where whole trials hold
    the base in another one.
    """
    theta, noises = rival.theta[: len(base.theta)], (base.noise, rival.noise)
    noise = max(noises, key=lambda n: log_posterior(base.hypothesis, theta, trials.short, n))
    other = refit(base.hypothesis, theta, trials.searched, noise)
    return other if other.log_posterior - base.log_posterior > NOISE_GAIN else base
