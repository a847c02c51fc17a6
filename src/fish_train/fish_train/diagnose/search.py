"""Which effect explains the mismatch: rank all candidates, refit the best, compare.

Every hypothesis refits all nominal parameters: an effect counts only for what they cannot absorb. The first ranking runs
at the noise of the model without the effect, inflated by what that model lacks, with the IMU believed a tenth: there the
likelihood has few optima. A structural effect (slip, hardening) may be absorbed so deeply that no path leads from
the fitted base to the truth, so every candidate is tried from the base and from the nominal values, weak and strong.
Where the base already leaves no more than water does, one step from it is enough.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fish_train.diagnose.base import from_nominal, look_again, settle_base
from fish_train.identify.adapt import adapt_noise, settle
from fish_train.identify.cold import FIRST_STEPS, SUSPICIOUS, TOO_STRONG, better, excess
from fish_train.identify.cores import on_all_cores
from fish_train.identify.experiment import Experiment, shorten
from fish_train.identify.filter import prepare
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import Fit, climb, evaluate, log_posterior
from fish_train.identify.hypothesis import Coordinates, Hypothesis, effect_class, extend, specification
from fish_train.identify.suitable import open_gates

STRENGTHS = (0.3, 1.0)  # in typical ones, from which a candidate is tried
WEAK_STRENGTHS = (0.05, 0.3)  # where little is left: no step leads back from far too strong an effect
SCALE = 0.3  # strength at which the hypothesis is written down; sets the coordinates only
IMU_DISTRUST = 10.0  # factor of the IMU's noise in the first part of the ranking
RANK_ITERATIONS = 6
POLISH_ITERATIONS = 4
STRENGTH_ITERATIONS = 3  # nearly linear; the climb in everything begins where it ends
PROMISING_PLACES = 3  # of those that are tried
POLISHED = 8  # candidates that are ranked with the IMU's own noise
SHORTLIST = 4
MOST_SEARCHES = 3  # with one base after the other, each a better optimum
POOR_BASE = 0.5  # share of the best candidate's gain that a better optimum of the base has as well
WORTH_A_REFIT = (
    0.2  # share of the best ranking gain, and of a gain that is enough: a refit on whole trials gains more
)
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
    return float(fit.log_likelihood.sum()) / temper + log_prior - 0.5 * float(np.linalg.slogdet(normal)[1])


def rank(base: Fit, names: Sequence[str], experiment: Experiment, progress: Progress) -> tuple[Ranked, ...]:
    """All candidates added to the base one at a time, on short trials, the most promising polished."""
    short = shorten(experiment, FIRST_STEPS)
    reference = climb(evaluate(base.hypothesis, base.theta, short, base.noise), short, POLISH_ITERATIONS)
    compile_all(base, names, progress)
    near = excess(base).max() < SUSPICIOUS

    def look(place: int) -> Fit:
        progress(f"ranking {names[place]} ({place + 1} of {len(names)})")
        return look_near(reference, names[place], short) if near else look_afar(base, names[place], short)

    found = dict(zip(names, on_all_cores(look, range(len(names))), strict=True))
    progress("ranking the most promising")
    promising = sorted(names, key=lambda name: -promise(found[name]))[:POLISHED]
    polished = on_all_cores(lambda name: climb(found[name], short, POLISH_ITERATIONS), promising)
    found |= zip(promising, polished, strict=True)
    gains = [Ranked(name, fit.objective - reference.objective, fit.theta) for name, fit in found.items()]
    return tuple(sorted(gains, key=lambda r: -r.gain))


def look_afar(base: Fit, name: str, short: Experiment) -> Fit:
    """A candidate where the base is far from the truth: from the best of all starts, the IMU believed little at first."""
    own = base.noise
    wide = replace(open_gates(own), gyro=IMU_DISTRUST * own.gyro, accel=IMU_DISTRUST * own.accel)
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    cold = replace(base, theta=np.where(Coordinates(base.hypothesis).is_log, 0.0, base.theta))
    starts = [*warm_starts(base, name, short, wide), *warm_starts(cold, name, short, wide)]
    start = max(starts, key=lambda theta: log_posterior(hypothesis, theta, short, wide))
    fit = climb(in_strength(evaluate(hypothesis, start, short, wide), name, short), short, RANK_ITERATIONS)
    return evaluate(hypothesis, fit.theta, short, own)


def look_near(base: Fit, name: str, short: Experiment) -> Fit:
    """A candidate where the base leaves no more than water does: what is missing is small, so one step tells its gain."""
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    starts = warm_starts(base, name, short, base.noise, WEAK_STRENGTHS)
    fits = [in_strength(evaluate(hypothesis, theta, short, base.noise), name, short) for theta in starts]
    return max(fits, key=promise)


def in_strength(fit: Fit, name: str, short: Experiment) -> Fit:
    """A candidate that has a place, climbed in all but this: while an effect is weak its place seems free, and a step loses it.

    Separable least squares (Golub and Pereyra 1973): in its strength a fit is nearly linear.
    """
    moving = strengths_of(fit.hypothesis, name)
    return fit if moving.all() else climb(fit, short, STRENGTH_ITERATIONS, moving=moving)


def compile_all(base: Fit, names: Sequence[str], progress: Progress) -> None:
    """Build every candidate's kernel, which the first run on a machine has to do, on all cores."""
    progress("compiling what is not in the cache yet")
    on_all_cores(lambda name: prepare(base.hypothesis.with_effect(name, SCALE).robot), names)


def warm_starts(
    base: Fit, name: str, experiment: Experiment, noise: Noise, strengths: Sequence[float] = STRENGTHS
) -> list[np.ndarray]:
    """theta of the base with a candidate at its best place, weak and strong where this leaves its strength open."""
    place = best_place(base, name, experiment, noise)
    if place.keys() >= set(effect_class(name).strength):  # how strong says the place itself
        strengths = strengths[:1]
    return [started(base, name, strength, place) for strength in strengths]


def started(base: Fit, name: str, strength: float, place: Mapping[str, float]) -> np.ndarray:
    """theta of the base with a candidate of this strength, in typical ones, at this place."""
    return extend(base.theta, base.hypothesis.with_effect(name, SCALE), name, strength, place)


def best_place(base: Fit, name: str, experiment: Experiment, noise: Noise) -> dict[str, float]:
    """Values of the parameters that say where or how fast, of those to be tried, from which the effect gains most.

    The few that promise most are climbed at their place: far from the base a promise is not kept.
    """
    keys = tried(name)
    places = [dict(zip(keys, v, strict=True)) for v in product(*(specification(name)[k].tries for k in keys))]
    if len(places) == 1:
        return places[0]
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    fits = [evaluate(hypothesis, started(base, name, SCALE, p), experiment, noise) for p in places]
    promising = sorted(range(len(places)), key=lambda i: -promise(fits[i]))[:PROMISING_PLACES]
    return places[max(promising, key=lambda i: in_strength(fits[i], name, experiment).objective)]


def tried(name: str) -> list[str]:
    """Parameters of an effect that say where, how fast or from where on, of which several values are tried."""
    return [key for key, parameter in specification(name).items() if parameter.tries]


def strengths_of(hypothesis: Hypothesis, name: str) -> NDArray[np.bool_]:
    """(K,) all free parameters but those of the effect that say where or how fast."""
    return np.array([free not in {f"{name}.{key}" for key in tried(name)} for free in hypothesis.free])


def promise(fit: Fit) -> float:
    """Objective that one Gauss-Newton step would reach, were the problem quadratic."""
    gradient = fit.result.gradient.sum(0) + fit.theta / Coordinates(fit.hypothesis).prior ** 2
    if not np.isfinite(fit.objective):
        return -np.inf
    return fit.objective + 0.5 * float(gradient @ np.linalg.solve(fit.normal, gradient))


def look_alike(first: str, second: str) -> bool:
    """Two names that are easily taken for each other."""
    return any(first in group and second in group for group in LOOK_ALIKES)


def shortlist(ranking: Sequence[Ranked]) -> list[Ranked]:
    """The best few and the look-alikes of the very best, as far as they come near it."""
    best = ranking[0]
    near = [r for r in ranking if r.gain > WORTH_A_REFIT * best.gain]
    return [r for i, r in enumerate(near) if i < SHORTLIST or look_alike(r.name, best.name)]


def refit(base: Fit, ranked: Ranked, experiment: Experiment) -> Fit:
    """A candidate on whole trials with its own noise, from the ranking's optimum."""
    hypothesis = base.hypothesis.with_effect(ranked.name, SCALE)
    start = evaluate(hypothesis, ranked.theta, experiment, base.noise)
    # the base's noise has taken the mismatch in, also as sensor noise
    start = evaluate(hypothesis, ranked.theta, experiment, adapt_noise(start, experiment))
    return look_again(settle(start, experiment), experiment)


def refit_beside(best: Fit, base: Fit, name: str, experiment: Experiment, enough: float) -> Fit | None:
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


def search_round(base: Fit, needed: Mapping[str, float], experiment: Experiment, progress: Progress) -> Round:
    """Rank all names on top of the base and refit the shortlist; nothing that gains far fewer nats than it needs."""
    names = tuple(needed)
    ranking = rank(base, names, experiment, progress)
    progress("first: " + ", ".join(f"{r.name} {r.gain:.0f}" for r in ranking[:5]) + " nats")
    chosen = [r for r in shortlist(ranking) if r.gain > WORTH_A_REFIT * needed[r.name]]
    if chosen:
        progress("refitting " + ", ".join(r.name for r in chosen))
    fits = on_all_cores(lambda ranked: refit(base, ranked, experiment), chosen)
    refitted = dict(zip((r.name for r in chosen), fits, strict=True))
    enough = min(needed.values())
    found = best_cold(Round(base, ranking, refitted), experiment, enough, progress)
    return with_look_alikes(found, names, experiment, enough, progress)


def best_cold(found: Round, experiment: Experiment, enough: float, progress: Progress) -> Round:
    """The round with its best candidate fitted cold where it needs a force that no pool has, and its rivals from there."""
    best = found.best
    if best is None or found.gain(best) < enough or excess(found.refitted[best]).max() <= TOO_STRONG:
        return found
    progress(f"fitting once more with {best}, from the nominal values")
    cold = from_nominal(found.refitted[best], experiment)
    if cold.objective - found.refitted[best].objective < enough:
        return found
    refitted = {**found.refitted, best: cold}
    for name in found.refitted.keys() - {best}:
        fit = refit_beside(cold, found.base, name, experiment, enough)
        if fit is not None:
            refitted[name] = better(fit, refitted[name])
    return replace(found, refitted=refitted)


def with_look_alikes(
    found: Round, names: Sequence[str], experiment: Experiment, enough: float, progress: Progress
) -> Round:
    """The round with every look-alike of the best that is not as good yet refitted from where the best led."""
    for name in names:
        best = found.best
        if best is None or name == best or not look_alike(name, best) or found.near_best(name, enough):
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
        if restarted.objective - base.objective <= max(POOR_BASE * (best.objective - base.objective), enough):
            return found
        base = restarted
    return found


def restart_base(base: Fit, rival: Fit, experiment: Experiment) -> Fit:
    """The base refitted from a rival's nominal parameters and noise: a base in a poor optimum looks like missing physics."""
    theta = rival.theta[: len(base.theta)]
    noises = (base.noise, rival.noise)
    noise = max(noises, key=lambda n: log_posterior(base.hypothesis, theta, experiment, n))
    fit = settle_base(evaluate(base.hypothesis, theta, experiment, noise), experiment)
    return better(base, fit)
