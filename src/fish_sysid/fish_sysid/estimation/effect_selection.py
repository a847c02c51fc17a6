"""Which effects let a wrong model predict trials better that it was not fitted to: forward selection by cross-validation.

For a robot whose recordings no likelihood explains (see `outlook`). Every candidate is fitted for the outlook on all trials;
the few that promise most are judged by trials left out in turn, each predicted by parameters fitted without it. The best is
added if it lowers the logarithm of their costs by more than one standard error over the trials (Breiman et al. 1984, ch. 3.4),
and so on. Trials that are held out of the whole identification take no part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.multistep_fit import SETTLED, MultistepError
from fish_sysid.estimation.parametrization import Hypothesis, extend

Array = NDArray[np.float64]

MOST_EFFECTS = 3
FOLDS = 4
JUDGED = 8  # candidates a round that are cross-validated: a good fit foretells little of a good prediction
EVERY = 2.0  # s between start points: half of those of the last fit
STRENGTHS = (0.3, 1.0)  # in typical ones, from which a candidate is fitted
SCALE = 0.3  # strength at which a hypothesis is written down; sets the coordinates only
SCREENING_STEPS = 4  # of Gauss-Newton
ROUNDS, ROUNDS_TO_THE_END = 2, 6  # of states and parameters: without a fold, on all trials

Report = Callable[[str], None]


@dataclass(frozen=True)
class Step:
    """What one candidate does to trials left out."""

    name: str
    gain: float  # mean over trials left out of the logarithm of their cost without it over that with it
    deviation: float  # its standard error over trials
    added: bool


def step_text(step: Step) -> str:
    """What it does, in words."""
    return f"predictions of trials left out cost {np.exp(-step.gain) - 1.0:+.0%} (a standard error: {step.deviation:.0%})"


@dataclass(frozen=True)
class _Tried:
    name: str
    hypothesis: Hypothesis
    theta: Array
    cost: float


@dataclass(frozen=True)
class _Judged:
    tried: _Tried
    costs: Array  # (M,) of trials left out
    step: Step


def choose_effects(
    fit: Fit, experiment: Experiment, names: Sequence[str], report: Report = lambda _: None
) -> tuple[Fit, tuple[Step, ...]]:
    """(the fit with the effects added, not settled yet; every candidate that was cross-validated).

    fit: of the model without them, for the outlook (`fit_multistep`).
    """
    steps: list[Step] = []
    if len(experiment.names) < 2 * FOLDS:
        return fit, ()
    without = left_out_costs(_outlook(fit.hypothesis), fit.theta, fit.noise, experiment)
    for number in range(MOST_EFFECTS):
        left = [name for name in names if name not in fit.hypothesis.names]
        screened, judged = list[_Tried](), list[_Judged]()
        # forked, so that a user's own effects are registered there as well
        with ProcessPoolExecutor(cores(), get_context("fork")) as pool:
            for tried in pool.map(partial(_screen, fit, experiment), left):
                screened.append(tried)
                report(f"effect {number + 1}: tried {tried.name} ({len(screened)} of {len(left)})")
            promising = sorted(screened, key=lambda t: t.cost)[:JUDGED]
            report(
                f"effect {number + 1}: leaving trials out to judge {', '.join(t.name for t in promising)}"
            )
            for found in pool.map(partial(_judge, fit, experiment, without), promising):
                judged.append(found)
                report(f"{found.tried.name}: {step_text(found.step)}")
        good = [j for j in judged if j.step.gain > j.step.deviation]
        best = max(good, key=lambda j: j.step.gain, default=None)
        steps += [
            replace(j.step, added=j is best) for j in sorted(judged, key=lambda j: -j.step.gain)
        ]
        if best is None:
            break
        fit = evaluate(best.tried.hypothesis, best.tried.theta, experiment, fit.noise)
        without = best.costs
    return fit, tuple(steps)


def _screen(fit: Fit, experiment: Experiment, name: str) -> _Tried:
    """A candidate fitted for the outlook on all trials, in a few steps."""
    hypothesis = fit.hypothesis.with_effect(name, SCALE)
    outlook = MultistepError(experiment, hypothesis, EVERY)
    starts = (extend(fit.theta, hypothesis, name, strength) for strength in STRENGTHS)

    def judged(theta: Array) -> tuple[float, Array]:
        outlook.start_from(theta, fit.noise)
        return outlook.cost(theta), theta

    _, theta = min(map(judged, starts), key=lambda found: found[0])
    cost, theta = outlook.improve(theta, fit.noise, SCREENING_STEPS)
    return _Tried(name, hypothesis, theta, cost)


def _settled(tried: _Tried, noise: Noise, experiment: Experiment) -> _Tried:
    """The candidate's fit on all trials, to the end: what it gains shall not be what the next one gains by going on."""
    outlook, cost, theta = (
        MultistepError(experiment, tried.hypothesis, EVERY),
        tried.cost,
        tried.theta,
    )
    for _ in range(ROUNDS_TO_THE_END):
        before = cost
        cost, theta = outlook.improve(theta, noise)
        if before - cost < SETTLED * before:
            break
    return replace(tried, theta=theta, cost=cost)


def _judge(fit: Fit, experiment: Experiment, without: Array, tried: _Tried) -> _Judged:
    """What a candidate, fitted to the end, does to trials left out, against their costs without it."""
    tried = _settled(tried, fit.noise, experiment)
    costs = left_out_costs(_outlook(tried.hypothesis), tried.theta, fit.noise, experiment)
    # logarithms: a trial that diverges without it would outweigh all others in a mean of costs
    ratio = np.log(without / costs)
    ratio = ratio[np.isfinite(ratio)]  # a trial too short to predict says nothing
    deviation = float(np.std(ratio, ddof=1) / np.sqrt(len(ratio)))
    return _Judged(tried, costs, Step(tried.name, float(ratio.mean()), deviation, False))


def _outlook(hypothesis: Hypothesis) -> Callable[[Experiment], MultistepError]:
    return partial(MultistepError, hypothesis=hypothesis, every=EVERY)


def left_out_costs(
    outlook_on: Callable[[Experiment], MultistepError],
    theta: Array,
    noise: Noise,
    experiment: Experiment,
    folds: int = FOLDS,
) -> Array:
    """(M,) mean cost per prediction of each trial by parameters that were fitted, from theta, without its fold.

    NaN for what no other fold can foretell.
    """
    count = len(experiment.names)
    costs = np.full(count, np.nan)
    for fold in range(min(folds, count)):
        left_out = [m for m in range(count) if m % folds == fold]
        rest = [m for m in range(count) if m % folds != fold]
        if not rest:
            continue
        others, fitted = outlook_on(experiment.select(rest)), theta
        for _ in range(ROUNDS):
            _, fitted = others.improve(fitted, noise)
        unseen = outlook_on(experiment.select(left_out))
        unseen.start_from(fitted, noise)
        costs[left_out] = unseen.mean_costs(fitted)
    return costs
