"""What of a grown model is superfluous, or was taken for something else, now that all of it is there.

An effect that was found while another one was missing competed beside what the other one does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.forward_selection import evidence, look_alike
from fish_sysid.diagnosis.refit import settle_base
from fish_sysid.diagnosis.result import Accepted
from fish_sysid.diagnosis.screening import SCALE, Progress, warm_starts
from fish_sysid.diagnosis.significance import (
    PLAUSIBLE,
    TEMPER,
    Level,
    parameter_count,
    probabilities,
)
from fish_sysid.estimation.map_fit import Fit, evaluate, log_posterior
from fish_sysid.estimation.noise_estimation import adapt_noise


def prune(
    final: Fit, accepted: list[Accepted], training: Experiment, level: Level, progress: Progress
) -> tuple[Fit, list[Accepted]]:
    """Every effect but the last without or against its rivals once more, beside what was found after it."""
    kept: list[Accepted] = accepted[-1:]
    for candidate in accepted[:-1]:
        progress(f"without {candidate.name}?")
        less = settle_base(without(final, candidate.name, training), training)
        samples = float(final.result.samples.sum())
        if final.objective - less.objective < level.enough(
            samples, parameter_count(candidate.name), 1
        ):
            final = less
            continue
        best = contested(candidate, final, training, level, progress)
        final = best.contest[best.name]
        kept.insert(-1, best)
    return final, kept


def contested(
    candidate: Accepted, final: Fit, training: Experiment, level: Level, progress: Progress
) -> Accepted:
    """An effect, or the simpler look-alike that does as well, with its rivals refitted in its place of the final model."""
    name, fits = candidate.name, {candidate.name: final}
    for other in rivals(candidate, final):
        progress(f"{other} instead of {name}?")
        fits[other] = exchanged(final, name, other, training)
    return replace(candidate, name=simplest(name, fits, level), contest=fits)


def rivals(candidate: Accepted, final: Fit) -> list[str]:
    """Names that competed in an effect's round, are not in the final model, and were plausible or are simpler look-alikes."""
    name = candidate.name
    others = set(final.hypothesis.names) - {name}
    plausible = odds({n: fit for n, fit in candidate.contest.items() if n not in others})
    return [
        n
        for n, probability in plausible.items()
        if n != name
        and (
            probability > PLAUSIBLE
            or (look_alike(n, name) and parameter_count(n) < parameter_count(name))
        )
    ]


def simplest(best: str, fits: Mapping[str, Fit], level: Level) -> str:
    """The best name, or a look-alike with fewer parameters that comes so near that the others are not worth having."""
    for name, fit in fits.items():
        extra = parameter_count(best) - parameter_count(name)
        if extra <= 0 or not look_alike(name, best):
            continue
        if fits[best].objective - fit.objective < level.enough(
            float(fit.result.samples.sum()), extra, 1
        ):
            best = name
    return best


def odds(fits: Mapping[str, Fit]) -> dict[str, float]:
    """Probability of every name, equally probable beforehand, the most probable first."""
    found = probabilities({name: evidence(fit, TEMPER) for name, fit in fits.items()})
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def exchanged(fit: Fit, name: str, other: str, experiment: Experiment) -> Fit:
    """The fit with another effect in the place of one of its own, fitted."""
    less = switched_off(fit, name, experiment)
    hypothesis = less.hypothesis.with_effect(other, SCALE)
    starts = warm_starts(less, other, experiment, fit.noise)
    theta = max(starts, key=lambda start: log_posterior(hypothesis, start, experiment, fit.noise))
    return settle_base(evaluate(hypothesis, theta, experiment, fit.noise), experiment)


def without(fit: Fit, name: str, experiment: Experiment) -> Fit:
    """The fit less one effect with the noise that it then needs, its other parameters as they are."""
    less = switched_off(fit, name, experiment)
    return evaluate(less.hypothesis, less.theta, experiment, adapt_noise(less, experiment))


def switched_off(fit: Fit, name: str, experiment: Experiment) -> Fit:
    """The fit less one effect, its other parameters as they are."""
    smaller = fit.hypothesis.without(name)
    keep = [i for i, free in enumerate(fit.hypothesis.free) if free in smaller.free]
    return evaluate(smaller, fit.theta[keep], experiment, fit.noise)
