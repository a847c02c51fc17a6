"""Which effect explains the mismatch: rank all candidates, refit the best, compare, add one, search again.

Every hypothesis refits all nominal parameters and the intensity of the latent wrench: an effect counts only for
what they cannot absorb. The first ranking runs at the nominal model's own, inflated noise, where the likelihood has
few optima; the shortlist is refitted with the noise adapted to each hypothesis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fish_train.identify.experiment import Experiment, shorten
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import Fit, adapt_noise, climb, evaluate, fit_hypothesis
from fish_train.identify.hypothesis import Coordinates, Hypothesis

RANK_START = 0.3  # strength, in typical ones, from which a candidate is tried
RANK_STEPS = 1000  # of 10 ms: half a trial is enough to rank
RANK_ITERATIONS = 2
SHORTLIST = 4
LOOK_ALIKES = (
    ("tip_slip", "wake_memory", "tail_joint_damping"),
    ("rudder_lag", "rudder_delay"),
    ("quadratic_drag", "dry_friction"),
    ("rudder_offset", "camera_heading_offset", "hull_asymmetry"),
    ("current", "nonuniform_current"),
)

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Ranked:
    """A candidate after the quick ranking."""

    name: str
    gain: float  # nats over the base at the base's noise
    theta: np.ndarray


@dataclass(frozen=True)
class Round:
    """One round of the search: what competed to be added to `base`."""

    base: Fit
    ranking: tuple[Ranked, ...]
    refitted: dict[str, Fit]  # shortlist, noise adapted

    @property
    def best(self) -> str | None:
        """Name of the best refitted candidate."""
        return max(self.refitted, key=lambda name: self.refitted[name].objective, default=None)

    def gain(self, name: str) -> float:
        """Nats over the base, both with their own noise."""
        return self.refitted[name].objective - self.base.objective


def rank(base: Fit, names: Sequence[str], experiment: Experiment, progress: Progress) -> tuple[Ranked, ...]:
    """All candidates added to the base one at a time, a few iterations each at the base's noise, on short trials."""
    short = shorten(experiment, RANK_STEPS)
    reference = climb(evaluate(base.hypothesis, base.theta, short, base.noise), short, RANK_ITERATIONS)
    found = []
    for name in names:
        progress(f"ranking {name}")
        hypothesis = extend(base, name, RANK_START)
        own = Coordinates(hypothesis).origin()[len(base.theta) :]
        start = evaluate(hypothesis, np.concatenate([base.theta, own]), short, base.noise)
        climbed = climb(start, short, RANK_ITERATIONS)
        found.append(Ranked(name, climbed.objective - reference.objective, climbed.theta))
    return tuple(sorted(found, key=lambda r: -r.gain))


def extend(base: Fit, name: str, start: float) -> Hypothesis:
    """The base's hypothesis (with its own start values, so that theta keeps its meaning) and one more effect."""
    return base.hypothesis.with_effect(name, start)


def shortlist(ranking: Sequence[Ranked]) -> list[str]:
    """The best few and the look-alikes of the very best."""
    names = [r.name for r in ranking[:SHORTLIST]]
    known = {r.name for r in ranking}
    for group in LOOK_ALIKES:
        if names and names[0] in group:
            names += [n for n in group if n not in names and n in known]
    return names


def refit(base: Fit, ranked: Ranked, experiment: Experiment) -> Fit:
    """A candidate with its noise adapted, from the ranking's optimum and cold; the better of the two."""
    hypothesis = extend(base, ranked.name, RANK_START)
    warm = climb(evaluate(hypothesis, ranked.theta, experiment, base.noise), experiment, 6)
    warm = climb(evaluate(hypothesis, warm.theta, experiment, adapt_noise(warm, experiment)), experiment, 6)
    origin = Coordinates(extend(base, ranked.name, 1.0)).origin()
    cold_theta = np.concatenate([0.0 * base.theta, origin[len(base.theta) :]])
    cold = fit_hypothesis(hypothesis, experiment, Noise(), cold_theta, iterations=8, rounds=2)
    return max(warm, cold, key=lambda f: f.objective)


def search_round(
    base: Fit, names: Sequence[str], experiment: Experiment, enough: float, progress: Progress
) -> Round:
    """Rank all names on top of the base and refit the shortlist; nothing is refitted if no rank gain is near `enough`."""
    ranking = rank(base, names, experiment, progress)
    chosen = [r for r in ranking if r.name in shortlist(ranking)] if ranking[0].gain > 0.2 * enough else []
    refitted = {}
    for r in chosen:
        progress(f"refitting {r.name}")
        refitted[r.name] = refit(base, r, experiment)
    return Round(base, ranking, refitted)


def restart_base(base: Fit, rivals: Sequence[Fit], experiment: Experiment) -> Fit:
    """The base refitted from every rival's nominal parameters: a base in a poor optimum looks like missing physics."""
    best = base
    for rival in rivals:
        theta = rival.theta[: len(base.theta)]
        fit = climb(evaluate(base.hypothesis, theta, experiment, base.noise), experiment, 6)
        fit = climb(
            evaluate(base.hypothesis, fit.theta, experiment, adapt_noise(fit, experiment)), experiment, 6
        )
        if fit.objective > best.objective:
            best = fit
    return best
