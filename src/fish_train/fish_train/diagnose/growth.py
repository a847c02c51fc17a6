"""A model that grows by one effect at a time while one is significant, and is pruned of what that has made superfluous."""

from __future__ import annotations

from collections.abc import Sequence

from fish_train.diagnose.base import anneal, refine, settle_base
from fish_train.diagnose.decide import SMALLEST_CHECK, SMALLEST_Z, Level, parameter_count, strength_z
from fish_train.diagnose.diagnosis import Accepted
from fish_train.diagnose.search import (
    SCALE,
    Progress,
    Round,
    evidence,
    look_alike,
    settled_round,
    warm_starts,
)
from fish_train.diagnose.split import Trials
from fish_train.diagnose.unseen import gain_left_out, gain_unseen, on_all
from fish_train.identify.cores import on_all_cores
from fish_train.identify.experiment import Experiment
from fish_train.identify.fit import Fit, evaluate, log_posterior

MOST_EFFECTS = 3
FAIR_SHARE = 0.5  # of the gain that a true effect shows on trials not fitted to: half-way to it


def grow(
    base: Fit, trials: Trials, competing: Sequence[str], level: Level, progress: Progress
) -> tuple[Fit, list[Round], list[Accepted]]:  # fmt: skip
    """Add one effect at a time while one is significant."""
    rounds: list[Round] = []
    accepted: list[Accepted] = []
    experiment = trials.searched
    while len(accepted) < min(MOST_EFFECTS, len(competing)):
        names = [n for n in competing if n not in base.hypothesis.names]
        samples = float(base.result.samples.sum())
        needed = {name: level.enough(samples, parameter_count(name), len(names)) for name in names}
        found = settled_round(base, needed, experiment, progress)
        rounds.append(found)
        name = choose(found, trials, len(names), level)
        if name is None:
            break
        accepted.append(Accepted(name, found))
        base = anneal(found.refitted[name], experiment)
        progress(f"found {name}: {found.gain(name):.0f} nats")
    return base, rounds, accepted


def choose(found: Round, trials: Trials, tried: int, level: Level) -> str | None:
    """The name to add: most evidence among the significant ones, the simplest of those that are as good."""
    samples = float(found.base.result.samples.sum())
    good = significant(found, samples, tried, level)
    base = on_all(found.base, trials.training) if good else found.base
    good = [name for name in good if holds_elsewhere(base, found.refitted[name], trials, tried, level)]
    if not good:
        return None
    best = max(good, key=lambda name: evidence(found.refitted[name]))
    for name in good:
        extra = parameter_count(best) - parameter_count(name)
        lost = found.gain(best) - found.gain(name)
        if extra > 0 and look_alike(name, best) and lost < level.enough(samples, extra, 1):
            best = name
    return best


def significant(found: Round, samples: float, tried: int, level: Level) -> list[str]:
    """Refitted names with enough gain, and a strength that differs from neutral."""
    return [
        name
        for name, fit in found.refitted.items()
        if found.gain(name) > level.enough(samples, parameter_count(name), tried)
        and strength_z(fit, name) > SMALLEST_Z
    ]


def holds_elsewhere(base: Fit, fit: Fit, trials: Trials, tried: int, level: Level) -> bool:
    """Whether a fit foretells trials that it was not fitted to, better than the base on all trials does.

    A fair share of what it would gain on the check if it were true; where the check is too calm for that, enough on every
    training trial in turn.
    """
    everywhere = on_all(fit, trials.training)
    gain, expected = gain_unseen(base, everywhere, trials.check)
    if expected < SMALLEST_CHECK:
        return gain_left_out(base, everywhere) > level.enough_unseen(float(base.result.samples.sum()), tried)
    return gain > max(FAIR_SHARE * expected, SMALLEST_CHECK)


def final_fits(base: Fit, rounds: list[Round], training: Experiment) -> tuple[Fit, Fit]:
    """Nominal and final structure on all training trials, from their optima on the search trials."""
    if not base.hypothesis.names:
        nominal = refine(base, training)
        return nominal, nominal
    nominal, final = on_all_cores(lambda fit: refine(fit, training), [rounds[0].base, base])
    return nominal, final


def prune(
    final: Fit, accepted: list[Accepted], training: Experiment, level: Level, progress: Progress
) -> tuple[Fit, list[Accepted]]:
    """Take effects out again that the others have made superfluous, and put in simpler look-alikes that do as well beside them.

    An effect that was found while another one was missing may have been taken for something richer than it is.
    """
    samples = float(final.result.samples.sum())
    for candidate in list(accepted)[:-1] if len(accepted) > 1 else []:
        name = candidate.name
        progress(f"without {name}?")
        fit = settle_base(switched_off(final, name, training), training)
        if final.objective - fit.objective < level.enough(samples, parameter_count(name), 1):
            final, accepted = fit, [a for a in accepted if a is not candidate]
            continue
        for other in simpler(candidate, final):
            progress(f"{other} instead of {name}?")
            fit = exchanged(final, name, other, training)
            extra = parameter_count(name) - parameter_count(other)
            if final.objective - fit.objective < level.enough(samples, extra, 1):
                new = Accepted(other, candidate.round)
                final, accepted = fit, [new if a is candidate else a for a in accepted]
                break
    return final, accepted


def simpler(candidate: Accepted, final: Fit) -> list[str]:
    """Look-alikes with fewer parameters that competed in the candidate's round, the simplest first."""
    name = candidate.name
    names = [
        n
        for n in candidate.round.refitted
        if look_alike(n, name)
        and parameter_count(n) < parameter_count(name)
        and n not in final.hypothesis.names
    ]
    return sorted(names, key=parameter_count)


def exchanged(fit: Fit, name: str, other: str, experiment: Experiment) -> Fit:
    """The fit with another effect in the place of one of its own, fitted."""
    less = switched_off(fit, name, experiment)
    hypothesis = less.hypothesis.with_effect(other, SCALE)
    starts = warm_starts(less, other, experiment, fit.noise)
    theta = max(starts, key=lambda start: log_posterior(hypothesis, start, experiment, fit.noise))
    return settle_base(evaluate(hypothesis, theta, experiment, fit.noise), experiment)


def switched_off(fit: Fit, name: str, experiment: Experiment) -> Fit:
    """The fit less one effect, its other parameters as they are."""
    smaller = fit.hypothesis.without(name)
    keep = [i for i, free in enumerate(fit.hypothesis.free) if free in smaller.free]
    return evaluate(smaller, fit.theta[keep], experiment, fit.noise)
