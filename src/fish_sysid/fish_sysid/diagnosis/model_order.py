# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Model order: how many links stand for the tail. It competes with the candidates but is no name.

A tail that bends continuously, described by too few links, leaves a force that candidates would take up.
"""

from __future__ import annotations

from fish_sim.robot import MAX_LINKS
from fish_sysid.diagnosis.cross_validation import gain_unseen, on_all
from fish_sysid.diagnosis.forward_selection import Selection
from fish_sysid.diagnosis.residual_regression import Law, residual_law
from fish_sysid.diagnosis.significance import evidence
from fish_sysid.diagnosis.task import Task
from fish_sysid.estimation.map_fit import Fit, better
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import ANNEAL, ANNEAL_HELD, ANNEAL_NEAR, multistart_fit, refit
from fish_sysid.estimation.shooting.prediction_fit import with_links
from fish_sysid.estimation.thresholds import (
    MORE_LINKS,
    PROMISING_NOISE,
    PROMISING_RATIO,
    RATIO_SUSPECT,
    SMALLEST_CHECK,
)


def better_order(selection: Selection, law: Law, task: Task) -> Fit | None:
    """The nominal model with more tail links, where the search leaves more than water or a law and this explains more of it.

    law: what the selected model leaves on all training trials; the searched ones alone may not show it.
    """
    trials, level, best = task.trials, task.level, selection.base
    nominal, searched = selection.rounds[0].base, trials.searched
    seen = leaves_more(best, task)
    if not seen and not law.lawful(level):
        return None
    finer = max(finer_models(nominal, best, seen, task), key=evidence, default=None)
    if finer is None or evidence(finer) < evidence(best):
        return None
    needed = level.needed(nominal.samples, 1, len(MORE_LINKS))
    gain = finer.log_posterior - nominal.log_posterior
    if finer.largest_ratio > best.largest_ratio or gain < needed:
        return None
    finer = better(
        finer,
        refit(finer.hypothesis, finer.theta, searched, usual_noise(searched), ANNEAL_NEAR),
    )
    # a fair share of what the truth would gain is too much to ask: no number of links is the truth
    on_training = on_all(nominal, trials.training), on_all(finer, trials.training)
    if trials.check and not gain_unseen(*on_training, trials.check)[0] > SMALLEST_CHECK:
        return None
    gain = finer.log_posterior - nominal.log_posterior
    task.progress(f"the tail needs {finer.robot.links} links: {gain:.0f} nats")
    return finer


def finer_models(nominal: Fit, best: Fit, seen: bool, task: Task) -> list[Fit]:
    """Nominal models with more links, one after the other while each leaves more than water, and is better or nearly right.

    seen: whether the searched trials show what the best model leaves; else they cannot show what a finer one leaves.
    """
    found: list[Fit] = []
    for links in (task.robot.links + more for more in MORE_LINKS):
        if links > MAX_LINKS:
            break
        task.progress(f"fitting the nominal model with {links} tail links")
        found.append(fit_links(links, nominal, best, task))
        if not promises_more(found[-1], best) or (seen and not leaves_more(found[-1], task)):
            break
    return found


def leaves_more(fit: Fit, task: Task) -> bool:
    """Whether a fit leaves more than water does, or a law, in the searched trials."""
    if fit.largest_ratio >= RATIO_SUSPECT:
        return True
    return bool(residual_law(fit, task.trials.searched).lawful(task.level))


def fit_links(links: int, nominal: Fit, best: Fit, task: Task) -> Fit:
    """The nominal model with this number of links: the best of three ways, as each ends in a poor optimum on some fish.

    From many starts; annealed from the ratios to nominal values of fewer links; and annealed with the tail's inertias held.
    All are annealed on shortened trials and compared on whole ones.
    """
    experiment, short = task.trials.searched, task.trials.short
    noise = usual_noise(short)
    hypothesis = nominal_hypothesis(with_links(task.robot, links), nominal.hypothesis.free)
    many = multistart_fit(hypothesis, short, noise, places=(nominal.theta,))
    ahead = better(many, refit(hypothesis, nominal.theta, short, noise, ANNEAL))
    fit = refit(hypothesis, ahead.theta, experiment, ahead.noise)
    if promises_more(fit, best):
        return fit
    origin = hypothesis.parametrization.origin()
    held = refit(hypothesis, origin, short, noise, ANNEAL_HELD)
    return better(fit, refit(hypothesis, held.theta, experiment, held.noise))


def promises_more(fit: Fit, best: Fit) -> bool:
    """Whether a finer tail explains more than the best fit, or is nearly right with less than half of its process noise.

    Then one more link may be right even where this number is behind. A tail that is far from right lacks more than a link.
    """
    calmer = fit.largest_ratio < min(PROMISING_RATIO * best.largest_ratio, PROMISING_NOISE)
    return fit.log_posterior > best.log_posterior or calmer
