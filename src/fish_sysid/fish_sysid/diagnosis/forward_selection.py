"""Which effect explains the mismatch: rank all candidates, refit the best, compare.

Every hypothesis refits all nominal parameters: an effect counts only for what they cannot absorb.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.diagnosis.refit import (
    better_of,
    led_from_nominal,
    look_again,
    settle_base,
)
from fish_sysid.diagnosis.screening import (
    MANY,
    RANK_ITERATIONS,
    SCALE,
    Progress,
    Ranked,
    rank,
    warm_starts,
)
from fish_sysid.diagnosis.screening_cold import rank_afar
from fish_sysid.diagnosis.significance import parameter_count
from fish_sysid.estimation.global_fit import (
    FIRST_STEPS,
    TOO_STRONG,
    better,
    excess,
)
from fish_sysid.estimation.map_fit import (
    Fit,
    climb,
    evaluate,
    log_posterior,
)
from fish_sysid.estimation.noise_estimation import adapt_noise, settle
from fish_sysid.estimation.parametrization import Coordinates

SHORTLIST = 4
LED_SHORTLIST = 2
MOST_SEARCHES = 3  # with one base after the other, each a better optimum
POOR_BASE = 0.5  # share of the best candidate's gain that a better optimum of the base has as well
# share of the best ranking gain, and of a gain that is enough: a refit on whole trials gains more
WORTH_A_REFIT = 0.2
LOOK_ALIKES = (
    ("tip_slip", "wake_memory", "tail_joint_damping"),
    ("rudder_lag", "rudder_delay"),
    ("quadratic_drag", "dry_friction"),
    ("rudder_offset", "camera_heading_offset", "hull_asymmetry"),
    ("current", "nonuniform_current"),
)
Rank = Callable[[Fit, Sequence[str], Experiment, Progress], tuple[Ranked, ...]]
Few = Callable[[Sequence[Ranked]], list[Ranked]]
Refit = Callable[[Fit, Experiment, Ranked], Fit]


@dataclass(frozen=True)
class Round:
    """One round of the search: what competed to be added to `base`."""

    base: Fit
    ranking: tuple[Ranked, ...]
    refitted: dict[str, Fit]  # shortlist, noise adapted

    @property
    def best(self) -> str | None:
        """Name of the best refitted candidate by evidence."""
        return max(self.refitted, key=lambda name: evidence(self.refitted[name]), default=None)

    def near_best(self, name: str, enough: float) -> bool:
        """Whether a candidate was refitted and came as near the best as makes no difference."""
        best = max(fit.objective for fit in self.refitted.values())
        return name in self.refitted and best - self.refitted[name].objective < enough

    def gain(self, name: str) -> float:
        """Nats over the base, both with their own noise."""
        return self.refitted[name].objective - self.base.objective


def evidence(fit: Fit, temper: float = 1.0) -> float:
    """Laplace approximation of the log evidence (MacKay 2003, ch. 27): an unneeded parameter costs its Occam factor.

    temper: nats of innovations that are worth one nat of evidence; the prior counts in full.
    """
    weight = 1.0 / Coordinates(fit.hypothesis).prior ** 2
    log_prior = 0.5 * float(np.log(weight).sum() - np.sum(weight * fit.theta**2))
    normal = (fit.normal - np.diag(weight)) / temper + np.diag(weight)
    return (
        float(fit.log_likelihood.sum()) / temper
        + log_prior
        - 0.5 * float(np.linalg.slogdet(normal)[1])
    )


def look_alike(first: str, second: str) -> bool:
    """Two names that are easily taken for each other."""
    return any(first in group and second in group for group in LOOK_ALIKES)


def shortlist(ranking: Sequence[Ranked]) -> list[Ranked]:
    """The best few and the look-alikes of the very best, as far as they come near it."""
    best = ranking[0]
    near = [r for r in ranking if r.gain > WORTH_A_REFIT * best.gain]
    return [r for i, r in enumerate(near) if i < SHORTLIST or look_alike(r.name, best.name)]


def led_shortlist(ranking: Sequence[Ranked]) -> list[Ranked]:
    """The best and the next near it where the camera led them, which tells them apart; of very many numbers the best only."""
    best = ranking[0]
    near = [r for r in ranking if r.gain > WORTH_A_REFIT * best.gain]
    return [best, *(r for r in near[1:] if parameter_count(r.name) <= MANY)][:LED_SHORTLIST]


def refit(base: Fit, experiment: Experiment, ranked: Ranked) -> Fit:
    """A candidate on whole trials with its own noise, from the ranking's optimum."""
    hypothesis = base.hypothesis.with_effect(ranked.name, SCALE)
    start = evaluate(hypothesis, ranked.theta, experiment, base.noise)
    # the base's noise has taken the mismatch in, also as sensor noise
    start = evaluate(hypothesis, ranked.theta, experiment, adapt_noise(start, experiment))
    return look_again(settle(start, experiment), experiment)


def refit_led(base: Fit, experiment: Experiment, ranked: Ranked) -> Fit:
    """A candidate on whole trials with its own noise, led by the camera once more: the base is far off."""
    return led_from_nominal(
        base.hypothesis.with_effect(ranked.name, SCALE), ranked.theta, experiment
    )


def worth_a_refit(ranked: Ranked, needed: float) -> bool:
    """Whether a candidate may gain what it needs.

    Half a nat per number counts for nothing: so much an effect that is not there gains in the mean (Wilks 1938).
    """
    return ranked.gain - 0.5 * parameter_count(ranked.name) > WORTH_A_REFIT * needed


def refit_beside(
    best: Fit, base: Fit, name: str, experiment: Experiment, enough: float
) -> Fit | None:
    """A rival from the nominal parameters and the noise of the best, where what looks alike has its optimum.

    None where it stays more than `enough` behind on shortened trials.
    """
    hypothesis, short = base.hypothesis.with_effect(name, SCALE), shorten(experiment, FIRST_STEPS)
    beside = replace(base, theta=best.theta[: len(base.theta)])
    starts = warm_starts(beside, name, short, best.noise)
    start = max(starts, key=lambda theta: log_posterior(hypothesis, theta, short, best.noise))
    near = climb(evaluate(hypothesis, start, short, best.noise), short, RANK_ITERATIONS)
    if not near.objective > log_posterior(best.hypothesis, best.theta, short, best.noise) - enough:
        return None
    return settle(evaluate(hypothesis, near.theta, experiment, best.noise), experiment)


def search_round(
    base: Fit, needed: Mapping[str, float], experiment: Experiment, progress: Progress
) -> Round:
    """Rank all names on top of the base and refit the shortlist; nothing that gains far fewer nats than it needs.

    A base that leaves a force no pool has is ranked from afar first, and as any other where nothing is found so: 40 times
    usual water may be near enough.
    """
    names, enough = tuple(needed), min(needed.values())
    ways: list[tuple[Rank, Few, Refit]] = [(rank, shortlist, refit)]
    if excess(base).max() > TOO_STRONG:
        ways.insert(0, (rank_afar, led_shortlist, refit_led))
    for ranked, few, again in ways:
        ranking = ranked(base, names, experiment, progress)
        progress("first: " + ", ".join(f"{r.name} {r.gain:.0f}" for r in ranking[:5]) + " nats")
        chosen = [r for r in few(ranking) if worth_a_refit(r, needed[r.name])]
        if chosen:
            progress("refitting " + ", ".join(r.name for r in chosen))
        fits = on_all_cores(partial(again, base, experiment), chosen)
        found = Round(base, ranking, dict(zip((r.name for r in chosen), fits, strict=True)))
        if found.best is not None and found.gain(found.best) >= enough:
            break
    return with_look_alikes(found, names, experiment, enough, progress)


def with_look_alikes(
    found: Round, names: Sequence[str], experiment: Experiment, enough: float, progress: Progress
) -> Round:
    """The round with every look-alike of the best that is not as good yet refitted from where the best led."""
    for name in names:
        best = found.best
        if (
            best is None
            or name == best
            or not look_alike(name, best)
            or found.near_best(name, enough)
        ):
            continue
        progress(f"refitting {name} from where {best} led")
        fit = refit_beside(found.refitted[best], found.base, name, experiment, enough)
        if fit is not None:
            found = replace(
                found, refitted={**found.refitted, name: better(fit, found.refitted.get(name, fit))}
            )
    return found


def settled_round(
    base: Fit, needed: Mapping[str, float], experiment: Experiment, progress: Progress
) -> Round:
    """`search_round` from a base that the best candidate cannot lead to a better optimum: that would imitate its effect.

    needed: nats that each of the names must gain.
    """
    enough = min(needed.values())
    for _ in range(MOST_SEARCHES):
        found = search_round(base, needed, experiment, progress)
        if found.best is None or found.gain(found.best) < enough:
            return found
        best = found.refitted[found.best]
        progress("refitting without it, from where it led")
        restarted = restart_base(base, best, experiment)
        found = replace(found, base=restarted)
        if restarted.objective - base.objective <= max(
            POOR_BASE * (best.objective - base.objective), enough
        ):
            return found
        base = restarted
    return found


def restart_base(base: Fit, rival: Fit, experiment: Experiment) -> Fit:
    """The base refitted from a rival's nominal parameters and noise: a base in a poor optimum looks like missing physics."""
    theta, short = rival.theta[: len(base.theta)], shorten(experiment, FIRST_STEPS)
    noises = (base.noise, rival.noise)
    noise = max(noises, key=lambda n: log_posterior(base.hypothesis, theta, short, n))
    led = settle_base(evaluate(base.hypothesis, theta, short, noise), short)
    return better_of(base, led, short, experiment)
