"""Which effect explains the mismatch: rank all candidates, refit the best, compare.

Every hypothesis refits all nominal parameters: an effect counts only for what they cannot absorb. The first ranking runs
at the noise of the model without the effect, inflated by what that model lacks, with the IMU believed a tenth: there the
likelihood has few optima. A structural effect (slip, hardening) may be absorbed so deeply that no path leads from
the fitted base to the truth, so every candidate is tried from the base and from the nominal values, weak and strong.
Where the base already leaves no more than water does, one step from it is enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from fish_train.diagnose.decide import excess
from fish_train.identify.experiment import Experiment, shorten
from fish_train.identify.filter import prepare
from fish_train.identify.fit import Fit, adapt_noise, climb, evaluate, log_posterior, settle
from fish_train.identify.hypothesis import Coordinates
from fish_train.identify.settle import open_gates

STRENGTHS = (0.3, 1.0)  # in typical ones, from which a candidate is tried
SCALE = 0.3  # strength at which the hypothesis is written down; sets the coordinates only
IMU_DISTRUST = 10.0  # factor of the IMU's noise in the first part of the ranking
RANK_STEPS = 800  # of 10 ms: eight seconds of every trial are enough to rank
RANK_ITERATIONS = 6
POLISH_ITERATIONS = 4
POLISHED = 8  # candidates that are ranked with the IMU's own noise
SHORTLIST = 4
SUSPICIOUS = 3.0  # times the density of usual water: the fit is a poor optimum, or something is missing
WORTH_A_REFIT = 0.2  # share of the best ranking gain
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

    def gain(self, name: str) -> float:
        """Nats over the base, both with their own noise."""
        return self.refitted[name].objective - self.base.objective


def evidence(fit: Fit) -> float:
    """Laplace approximation of the log evidence (MacKay 2003, ch. 27): an unneeded parameter costs its Occam factor."""
    prior = Coordinates(fit.hypothesis).prior
    return fit.objective - 0.5 * float(np.linalg.slogdet(fit.normal)[1]) - float(np.log(prior).sum())


def rank(base: Fit, names: Sequence[str], experiment: Experiment, progress: Progress) -> tuple[Ranked, ...]:
    """All candidates added to the base one at a time, on short trials, the most promising polished."""
    short = shorten(experiment, RANK_STEPS)
    reference = climb(evaluate(base.hypothesis, base.theta, short, base.noise), short, POLISH_ITERATIONS)
    compile_all(base, names, progress)
    near = excess(base).max() < SUSPICIOUS
    found = []
    for i, name in enumerate(names):
        progress(f"ranking {name} ({i + 1} of {len(names)})")
        found.append(look_near(reference, name, short) if near else look_afar(base, name, short))
    progress("ranking the most promising")
    promising = sorted(range(len(found)), key=lambda i: -promise(found[i]))[:POLISHED]
    for i in promising:
        found[i] = climb(found[i], short, POLISH_ITERATIONS)
    gains = [Ranked(n, f.objective - reference.objective, f.theta) for n, f in zip(names, found, strict=True)]
    return tuple(sorted(gains, key=lambda r: -r.gain))


def look_afar(base: Fit, name: str, short: Experiment) -> Fit:
    """A candidate where the base is far from the truth: from the best of all starts, the IMU believed little at first."""
    own = base.noise
    wide = replace(open_gates(own), gyro=IMU_DISTRUST * own.gyro, accel=IMU_DISTRUST * own.accel)
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    start = max(starts(base, name), key=lambda theta: log_posterior(hypothesis, theta, short, wide))
    fit = climb(evaluate(hypothesis, start, short, wide), short, RANK_ITERATIONS)
    return evaluate(hypothesis, fit.theta, short, own)


def look_near(base: Fit, name: str, short: Experiment) -> Fit:
    """A candidate where the base leaves no more than water does: what is missing is small, so one step tells its gain."""
    hypothesis = base.hypothesis.with_effect(name, SCALE)
    fits = [evaluate(hypothesis, theta, short, base.noise) for theta in warm_starts(base, name)]
    return max(fits, key=promise)


def compile_all(base: Fit, names: Sequence[str], progress: Progress) -> None:
    """Build every candidate's kernel, which the first run on a machine has to do, on all cores."""
    progress("compiling what is not in the cache yet")
    with ThreadPoolExecutor() as pool:
        list(pool.map(lambda name: prepare(base.hypothesis.with_effect(name, SCALE).robot), names))


def starts(base: Fit, name: str) -> list[np.ndarray]:
    """theta from which a candidate is tried: from the base and from the nominal values, weak and strong."""
    cold = np.where(Coordinates(base.hypothesis).is_log, 0.0, base.theta)
    return warm_starts(base, name) + warm_starts(replace(base, theta=cold), name)


def warm_starts(base: Fit, name: str) -> list[np.ndarray]:
    """theta of the base with a candidate, weak and strong."""
    coordinates = Coordinates(base.hypothesis.with_effect(name, SCALE))
    robots = [base.hypothesis.with_effect(name, strength).robot for strength in STRENGTHS]
    own = [coordinates.encode(coordinates.read(robot))[len(base.theta) :] for robot in robots]
    return [np.concatenate([base.theta, values]) for values in own]


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
    return settle(start, experiment)


def search_round(
    base: Fit, names: Sequence[str], experiment: Experiment, enough: float, progress: Progress
) -> Round:
    """Rank all names on top of the base and refit the shortlist; nothing is refitted if no rank gain is near `enough`."""
    ranking = rank(base, names, experiment, progress)
    progress("first: " + ", ".join(f"{r.name} {r.gain:.0f}" for r in ranking[:5]) + " nats")
    chosen = shortlist(ranking) if ranking[0].gain > 0.1 * enough else []
    refitted = {}
    for r in chosen:
        progress(f"refitting {r.name}")
        refitted[r.name] = refit(base, r, experiment)
    return Round(base, ranking, refitted)


def restart_base(base: Fit, rival: Fit, experiment: Experiment) -> Fit:
    """The base refitted from a rival's nominal parameters and noise: a base in a poor optimum looks like missing physics."""
    theta = rival.theta[: len(base.theta)]
    noises = (base.noise, rival.noise)
    noise = max(noises, key=lambda n: log_posterior(base.hypothesis, theta, experiment, n))
    fit = settle(evaluate(base.hypothesis, theta, experiment, noise), experiment)
    return max(base, fit, key=lambda f: f.objective)
