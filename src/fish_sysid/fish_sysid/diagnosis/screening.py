"""How many nats every candidate gains, quickly: on short trials, at the noise of the model without it.

That noise is inflated by what the model lacks, and at first the IMU is believed a tenth: there the likelihood has few optima.
A structural effect (slip, hardening) may be absorbed so deeply that no path leads from the fitted base to the truth, so
every candidate is tried from the base and from the nominal values, weak and strong. Where the base already leaves no more
than water does, one step from it is enough; where it leaves a force that no pool has, see `ranking_afar`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.diagnosis.significance import parameter_count
from fish_sysid.estimation.ekf import prepare
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.global_fit import FIRST_STEPS, SUSPICIOUS, excess
from fish_sysid.estimation.initial_noise import open_gates
from fish_sysid.estimation.map_fit import (
    Fit,
    climb,
    evaluate,
    log_posterior,
)
from fish_sysid.estimation.parametrization import (
    Coordinates,
    Hypothesis,
    effect_class,
    extend,
    specification,
)

STRENGTHS = (0.3, 1.0)  # in typical ones, from which a candidate is tried
WEAK_STRENGTHS = (
    0.05,
    0.3,
)  # where little is left: no step leads back from far too strong an effect
SCALE = 0.3  # strength at which the hypothesis is written down; sets the coordinates only
IMU_DISTRUST = 10.0  # factor of the IMU's noise in the first part of the ranking
RANK_ITERATIONS = 6
POLISH_ITERATIONS = 4
STRENGTH_ITERATIONS = 3  # nearly linear; the climb in everything begins where it ends
PROMISING_PLACES = 3  # of those that are tried
POLISHED = 8  # candidates that are ranked with the IMU's own noise
MANY = 10  # numbers of an effect that are held while others are looked for beside it

Progress = Callable[[str], None]
Look = Callable[[Fit, str, Experiment], Fit]  # base, name, short trials


@dataclass(frozen=True)
class Ranked:
    """A candidate after the quick ranking."""

    name: str
    gain: float  # nats over the base, both at the same noise
    theta: np.ndarray


def rank(
    base: Fit, names: Sequence[str], experiment: Experiment, progress: Progress
) -> tuple[Ranked, ...]:
    """All candidates added to the base one at a time, on short trials, the most promising polished.

    An effect of very many numbers in the base is held while the candidates are looked for beside it and moves with them from
    where they are found: what it can absorb of a candidate is in that candidate's promise.
    """
    short = shorten(experiment, FIRST_STEPS)
    reference = climb(
        evaluate(base.hypothesis, base.theta, short, base.noise), short, POLISH_ITERATIONS
    )
    near = excess(base).max() < SUSPICIOUS
    start, look = (reference, look_near) if near else (base, look_afar)
    found = look_for(names, look, start, short, progress)
    promising = sorted(names, key=lambda name: -promise(found[name]))[:POLISHED]
    polished = on_all_cores(lambda name: climb(found[name], short, POLISH_ITERATIONS), promising)
    found |= zip(promising, polished, strict=True)
    return by_gain(found, reference.objective)


def look_for(
    names: Sequence[str], look: Look, base: Fit, short: Experiment, progress: Progress
) -> dict[str, Fit]:
    """Every candidate where `look` finds it beside what is held of the base, then with everything free."""
    compile_all(base, names, progress)
    held = holding(base, short)

    def one(place: int) -> Fit:
        name = names[place]
        progress(f"ranking {name} ({place + 1} of {len(names)})")
        return releasing(look(held, name, short), base, name, short)

    found = dict(zip(names, on_all_cores(one, range(len(names))), strict=True))
    progress("ranking the most promising")
    return found


def by_gain(found: Mapping[str, Fit], reference: float) -> tuple[Ranked, ...]:
    """The candidates, what gains most over the reference first."""
    gains = [Ranked(name, fit.objective - reference, fit.theta) for name, fit in found.items()]
    return tuple(sorted(gains, key=lambda ranked: -ranked.gain))


def crowd(hypothesis: Hypothesis) -> list[str]:
    """Free parameters of the effects that have very many."""
    owner = {free: free.split(".")[0] for free in hypothesis.free if "." in free}
    return [free for free, name in owner.items() if parameter_count(name) > MANY]


def holding(base: Fit, experiment: Experiment) -> Fit:
    """The base with its effects of very many numbers held: a pass with the derivatives to these takes several times as long."""
    held = crowd(base.hypothesis)
    if not held:
        return base
    moving = np.array([free not in held for free in base.hypothesis.free])
    return evaluate(
        base.hypothesis.fixing(held, base.theta), base.theta[moving], experiment, base.noise
    )


def releasing(fit: Fit, base: Fit, name: str, experiment: Experiment) -> Fit:
    """A candidate that was found beside what `holding` left of the base, with everything free."""
    if not crowd(base.hypothesis):
        return fit
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    theta = dict(zip(base.hypothesis.free, base.theta, strict=True))
    theta |= zip(fit.hypothesis.free, fit.theta, strict=True)
    return evaluate(
        hypothesis, np.array([theta[free] for free in hypothesis.free]), experiment, fit.noise
    )


def look_afar(base: Fit, name: str, short: Experiment) -> Fit:
    """A candidate where the base is far from the truth: from the best of all starts, the IMU believed little at first."""
    own, wide = base.noise, distrusting(base.noise, IMU_DISTRUST)
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    starts = [
        *warm_starts(base, name, short, wide),
        *warm_starts(from_nominal(base), name, short, wide),
    ]
    start = max(starts, key=lambda theta: log_posterior(hypothesis, theta, short, wide))
    fit = climb(
        in_strength(evaluate(hypothesis, start, short, wide), name, short), short, RANK_ITERATIONS
    )
    return evaluate(hypothesis, fit.theta, short, own)


def distrusting(noise: Noise, factor: float) -> Noise:
    """The IMU believed so much less, and nothing left out as an outlier."""
    return replace(open_gates(noise), gyro=factor * noise.gyro, accel=factor * noise.accel)


def from_nominal(base: Fit) -> Fit:
    """The base at the nominal values, its effects as they are; only `theta` is moved."""
    return replace(base, theta=Coordinates(base.hypothesis).at_nominal(base.theta))


def look_near(base: Fit, name: str, short: Experiment) -> Fit:
    """A candidate where the base leaves no more than water does: what is missing is small, so one step tells its gain."""
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    starts = warm_starts(base, name, short, base.noise, WEAK_STRENGTHS)
    fits = [
        in_strength(evaluate(hypothesis, theta, short, base.noise), name, short) for theta in starts
    ]
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
    base: Fit,
    name: str,
    experiment: Experiment,
    noise: Noise,
    strengths: Sequence[float] = STRENGTHS,
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

    The few that promise most are climbed at their place: far from the base a promise is not kept. A place where the effect
    does nothing is none: it would be as good as the base, and no step leads from there to a limit a little below.
    """
    keys = tried(name)
    places = [
        dict(zip(keys, v, strict=True))
        for v in product(*(specification(name)[k].tries for k in keys))
    ]
    if len(places) == 1:
        return places[0]
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    fits = [evaluate(hypothesis, started(base, name, SCALE, p), experiment, noise) for p in places]
    felt = [i for i, fit in enumerate(fits) if acts(fit, name)] or range(len(places))
    promising = sorted(felt, key=lambda i: -promise(fits[i]))[:PROMISING_PLACES]
    return places[max(promising, key=lambda i: in_strength(fits[i], name, experiment).objective)]


def acts(fit: Fit, name: str) -> bool:
    """Whether an effect of the fit changes anything: a limit that no command reaches does not, nor a line never taut."""
    own = [free.startswith(f"{name}.") for free in fit.hypothesis.free]
    return bool(np.diagonal(fit.result.normal.sum(0))[own].any())


def tried(name: str) -> list[str]:
    """Parameters of an effect that say where, how fast or from where on, of which several values are tried."""
    return [key for key, parameter in specification(name).items() if parameter.tries]


def strengths_of(hypothesis: Hypothesis, name: str) -> NDArray[np.bool_]:
    """(K,) all free parameters but those of the effect that say where or how fast."""
    return np.array(
        [free not in {f"{name}.{key}" for key in tried(name)} for free in hypothesis.free]
    )


def promise(fit: Fit) -> float:
    """Objective that one Gauss-Newton step would reach, were the problem quadratic."""
    gradient = fit.result.gradient.sum(0) + fit.theta / Coordinates(fit.hypothesis).prior ** 2
    if not np.isfinite(fit.objective):
        return -np.inf
    return fit.objective + 0.5 * float(gradient @ np.linalg.solve(fit.normal, gradient))
