"""A model that grows by one effect at a time while one is significant, and is pruned of what that has made superfluous."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_train.diagnose.base import anneal, refine
from fish_train.diagnose.decide import SMALLEST_CHECK, SMALLEST_Z, Level, parameter_count, strength_z
from fish_train.diagnose.diagnosis import Accepted
from fish_train.diagnose.search import Progress, Round, evidence, look_alike, settled_round
from fish_train.identify.experiment import Experiment
from fish_train.identify.fit import Fit, evaluate, trial_likelihoods
from fish_train.identify.settle import open_gates

MOST_EFFECTS = 3
FAIR_SHARE = 0.5  # of the gain that a true effect shows on trials not fitted to: half-way to it


def grow(
    base: Fit, experiment: Experiment, check: Experiment | None, competing: Sequence[str], level: Level,
    progress: Progress,
) -> tuple[Fit, list[Round], list[Accepted]]:  # fmt: skip
    """Add one effect at a time while one is significant."""
    rounds: list[Round] = []
    accepted: list[Accepted] = []
    while len(accepted) < min(MOST_EFFECTS, len(competing)):
        names = [n for n in competing if n not in base.hypothesis.names]
        samples = float(base.result.samples.sum())
        found = settled_round(base, names, experiment, level.enough(samples, 1, len(names)), progress)
        rounds.append(found)
        name = choose(found, check, len(names), level)
        if name is None:
            break
        accepted.append(Accepted(name, found))
        base = anneal(found.refitted[name], experiment)
        progress(f"found {name}: {found.gain(name):.0f} nats")
    return base, rounds, accepted


def choose(found: Round, check: Experiment | None, tried: int, level: Level) -> str | None:
    """The name to add: most evidence among the significant ones, the simplest of those that are as good."""
    samples = float(found.base.result.samples.sum())
    good = [
        name
        for name, fit in found.refitted.items()
        if is_significant(fit, found.gain(name), name, samples, tried, level)
        and (check is None or holds_elsewhere(found.base, fit, check))
    ]
    if not good:
        return None
    best = max(good, key=lambda name: evidence(found.refitted[name]))
    for name in good:
        extra = parameter_count(best) - parameter_count(name)
        lost = found.gain(best) - found.gain(name)
        if extra > 0 and look_alike(name, best) and lost < level.enough(samples, extra, 1):
            best = name
    return best


def is_significant(fit: Fit, gain: float, name: str, samples: float, tried: int, level: Level) -> bool:
    """Enough gain, and a strength that differs from neutral."""
    enough = level.enough(samples, parameter_count(name), tried)
    return gain > enough and strength_z(fit, name) > SMALLEST_Z


def holds_elsewhere(base: Fit, fit: Fit, check: Experiment) -> bool:
    """On trials that it was not fitted to, a fit must gain a fair share of what it would gain there if it were true."""
    gain, expected = gain_elsewhere(base, fit, check)
    return gain > max(FAIR_SHARE * expected, SMALLEST_CHECK)


def gain_elsewhere(base: Fit, fit: Fit, check: Experiment) -> tuple[float, float]:
    """Nats that a fit gains over the base on trials that neither was fitted to, and those that it would if it were true.

    With r the whitened innovations of the fit, white if it is true, and r + d those of the base under the same noise, the gain
    sum((r + d)^2 - r^2) / 2 is sum(d^2) / 2 in the mean: much where the effect acts, little on trials that do not excite it.
    """
    noise = open_gates(fit.noise)
    here = trial_likelihoods(fit.hypothesis, fit.theta, check, noise)
    there = trial_likelihoods(base.hypothesis, base.theta, check, noise)
    gain = float(here.log_likelihood.sum() - there.log_likelihood.sum())
    return gain, 0.5 * float(np.nansum((here.whitened - there.whitened) ** 2))


def final_fits(base: Fit, rounds: list[Round], training: Experiment) -> tuple[Fit, Fit]:
    """Nominal and final structure on all training trials, from their optima on the search trials."""
    if not base.hypothesis.names:
        nominal = refine(base, training)
        return nominal, nominal
    return refine(rounds[0].base, training), refine(base, training)


def prune(
    final: Fit, accepted: list[Accepted], training: Experiment, level: Level, progress: Progress
) -> tuple[Fit, list[Accepted]]:
    """Take effects out again that the others have made superfluous."""
    for candidate in list(accepted)[:-1] if len(accepted) > 1 else []:
        progress(f"without {candidate.name}?")
        fit = refine(switched_off(final, candidate.name, training), training)
        samples = float(final.result.samples.sum())
        if final.objective - fit.objective < level.enough(samples, parameter_count(candidate.name), 1):
            final, accepted = fit, [a for a in accepted if a is not candidate]
    return final, accepted


def switched_off(fit: Fit, name: str, experiment: Experiment) -> Fit:
    """The fit less one effect, its other parameters as they are."""
    smaller = fit.hypothesis.without(name)
    keep = [i for i, free in enumerate(fit.hypothesis.free) if free in smaller.free]
    return evaluate(smaller, fit.theta[keep], experiment, fit.noise)
