"""Where no name fits: the robot to go on with, whose predictions over seconds are best.

A likelihood misleads about a model that lacks something without a name: its parameters go where the next 50 ms are right. Here
every structure is fitted by its predictions alone (`identify.outlook`), from the nominal values, short horizons first, as long
ones have many optima. The filter's states follow what was measured (FOLLOWING), and no unexplained force acts on the
predictions: it would stand in for what the model lacks.

The structure grows by one effect at a time, of those that the search found nearest, those that change every stroke
(STRUCTURAL) and those that the predictions themselves call for (`_called_for`: a likelihood says little of what moves the
fish slowly), while its cost falls and trials left out are foretold better. It describes, for simulation and training; no effect
in it is a name of the answer. Where the nominal structure predicts better after all, that is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.vocabulary import kind_of
from fish_sysid.estimation.effect_selection import left_out_costs
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.initial_noise import open_gates
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.multistep_fit import HORIZONS, Outlook, fit_outlook
from fish_sysid.estimation.parametrization import (
    Coordinates,
    Hypothesis,
    extend,
    nominal_hypothesis,
)

Array = NDArray[np.float64]

# change every stroke; a bad base's linear scores say nothing of them
STRUCTURAL = ("tip_slip", "quadratic_drag")
MOST_EFFECTS = 3
CALLED = 2  # effects for which the nominal structure's predictions call most
FAINT = 0.1  # their strength, in typical ones, where that is asked: without any, where or how fast they act makes no difference
STAGES = ((0.5, 1.0), (0.5, 1.0, 2.0), HORIZONS)  # s
EVERY = 2.0  # s between start points
# times usual water: unexplained forces in the filter that gives the states, and in that of the predictions
FOLLOWING, CALM = 20.0, 5.0
STRENGTH = 0.3  # of an effect, in typical ones, from which it is fitted
ROUNDS = 8  # of states and parameters, in each stage
SETTLED = 0.005  # of the cost; a round that gains less is the last, and an effect no help
FOLDS = 3


@dataclass(frozen=True)
class _Tried:
    """A structure fitted by its predictions."""

    hypothesis: Hypothesis
    theta: Array
    cost: float


class Unpushed(Outlook):
    """Predictions on which no unexplained force acts."""

    def start_from(self, theta: Array, noise: Noise) -> None:
        """Take the start states from the filter with theta, the force that it needs left behind."""
        super().start_from(theta, noise)
        self.estimates = replace(self.estimates, wrench=np.zeros_like(self.estimates.wrench))


def stand_in(
    nominal: Fit,
    names: Sequence[str],
    experiment: Experiment,
    report: Callable[[str], None],
    candidates: Sequence[str] = (),
) -> Fit:
    """The model that predicts best; nominal: the fit without effects; names: effects that may help.

    candidates: effects of which those are tried, too, that the predictions call for. The nominal fit itself where no trial is
    long enough to predict.
    """
    plain = nominal_hypothesis(nominal.hypothesis.robot, nominal.hypothesis.free)
    if not Unpushed(experiment, plain, EVERY).targets:
        return nominal
    noise = _water(nominal.noise, FOLLOWING)
    report("no name fits: fitting predictions over seconds")
    best = _fitted(plain, [Coordinates(plain).origin(), nominal.theta], noise, experiment)
    called = _called_for(best, _moving(candidates), noise, experiment)
    helpful = dict.fromkeys((*_moving(names), *called))
    for _ in range(MOST_EFFECTS):
        left = [name for name in helpful if name not in best.hypothesis.names]
        tried = on_all_cores(partial(_grown, best, noise, experiment), left)
        promising = min(tried, key=lambda one: one.cost, default=best)
        falls = best.cost - promising.cost >= SETTLED * best.cost
        if not falls or not _foretells_better(best, promising, noise, experiment):
            break
        best = promising
        report(f"predictions are better with {', '.join(best.hypothesis.names)}")
    return _best_of(best, (nominal, fit_outlook(nominal, experiment, report)), experiment)


def _moving(names: Sequence[str]) -> list[str]:
    """Those that move the fish: a sensor's error predicts no motion."""
    return [name for name in names if kind_of(name) != "sensor"]


def _called_for(
    best: _Tried, names: Sequence[str], noise: Noise, experiment: Experiment
) -> list[str]:
    """The CALLED effects of whose parameters each promises the largest fall of the cost, in a Gauss-Newton step from best."""

    def fall(name: str) -> float:
        hypothesis = best.hypothesis.with_effect(name, FAINT)
        theta = extend(best.theta, hypothesis, name, FAINT)
        outlook = Unpushed(experiment, hypothesis, EVERY)
        outlook.start_from(theta, noise)
        return (best.cost - outlook.promised(theta)) / (len(theta) - len(best.theta))

    falls = dict(zip(names, on_all_cores(fall, names), strict=True))
    return sorted((name for name in names if falls[name] > 0.0), key=lambda name: -falls[name])[
        :CALLED
    ]


def _water(noise: Noise, times: float) -> Noise:
    """The noise of these sensors in water that pushes so many times as strongly as it usually does.

    Without gates: a filter of a wrong model that leaves out what surprises it loses the fish, and its states teach nothing.
    """
    usual = Noise()
    x, y, n = (times * size for size in usual.wrench)
    return open_gates(replace(noise, wrench=(x, y, n), wrench_time=usual.wrench_time))


def _grown(best: _Tried, noise: Noise, experiment: Experiment, name: str) -> _Tried:
    """The structure with one more effect, from the start values and from what it was without."""
    hypothesis = best.hypothesis.with_effect(name, STRENGTH)
    starts = [Coordinates(hypothesis).origin(), extend(best.theta, hypothesis, name, STRENGTH)]
    return _fitted(hypothesis, starts, noise, experiment)


def _fitted(
    hypothesis: Hypothesis, starts: Sequence[Array], noise: Noise, experiment: Experiment
) -> _Tried:
    """By predictions over longer and longer horizons, from the start that ends best."""

    def led(theta: Array) -> _Tried:
        for horizons in STAGES:
            cost, theta = _rounds(Unpushed(experiment, hypothesis, EVERY, horizons), theta, noise)
        return _Tried(hypothesis, theta, cost)

    return min(on_all_cores(led, starts), key=lambda tried: tried.cost)


def _rounds(outlook: Outlook, theta: Array, noise: Noise) -> tuple[float, Array]:
    """(cost, theta): states and parameters in turn while the cost falls."""
    before, cost = np.inf, np.inf
    for _ in range(ROUNDS):
        cost, theta = outlook.improve(theta, noise, shares=(1.0,))
        if before - cost < SETTLED * before:
            break
        before = cost
    return cost, theta


def _foretells_better(before: _Tried, after: _Tried, noise: Noise, experiment: Experiment) -> bool:
    """Trials left out cost less in the mean (of logarithms: no trial outweighs the others)."""

    def left_out(tried: _Tried) -> Array:
        outlook_on = partial(Unpushed, hypothesis=tried.hypothesis, every=EVERY)
        return left_out_costs(outlook_on, tried.theta, noise, experiment, FOLDS)

    without, with_it = on_all_cores(left_out, [before, after])
    return bool(np.nanmean(np.log(without / with_it)) > 0.0)


def _best_of(grown: _Tried, others: Sequence[Fit], experiment: Experiment) -> Fit:
    """What predicts training trials best as `predict` makes predictions: the filter's force dies away in them.

    Where the model is right but for a force that comes and goes, a likelihood and that force predict better than any structure.
    """

    def cost(fit: Fit | _Tried, noise: Noise) -> float:
        outlook = Outlook(experiment, fit.hypothesis, EVERY)
        outlook.start_from(fit.theta, noise)
        return float(np.nanmean(outlook.mean_costs(fit.theta)))

    noises = (_water(others[0].noise, CALM), others[0].noise)
    noise = min(noises, key=lambda noise: cost(grown, noise))
    best = min(others, key=lambda fit: cost(fit, fit.noise))
    if cost(best, best.noise) < cost(grown, noise):
        return best
    outlook = Unpushed(experiment, grown.hypothesis, EVERY)
    outlook.start_from(grown.theta, noise)
    normal = outlook.normal(grown.theta)
    return replace(evaluate(grown.hypothesis, grown.theta, experiment, noise), normal=normal)
