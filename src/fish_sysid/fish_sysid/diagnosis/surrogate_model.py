"""Surrogate model: where no name fits, the robot whose predictions over seconds are best.

The likelihood misleads a model that lacks something without a name: its parameters go where the next 50 ms are right. Here
every structure is fitted by its predictions alone (`estimation.multistep_fit`), from the nominal values, short horizons first,
as long ones have many optima. The filter's states follow the measurements (FOLLOWING), and no latent wrench acts on the
predictions: it would replace what the model lacks.

The structure grows by one effect at a time, of those that the search accepted, those that change every stroke (STRUCTURAL) and
those that lower the predictions' cost most, while the cost falls and left-out trials are predicted better. It serves simulation
and training; no effect in it is a name of the answer. Where the nominal structure predicts better, that is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fish_report.parallel import on_all_cores
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.effect_selection import left_out_costs
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.multistep_fit import HORIZONS, MultistepError, fit_multistep
from fish_sysid.estimation.parametrization import Hypothesis, extend, nominal_hypothesis

Array = NDArray[np.float64]

STRUCTURAL = ("tip_slip", "quadratic_drag")  # screening says little of them on a poor base
MOST_EFFECTS = 3
CHOSEN = 2  # effects that the nominal structure's predictions ask for most
FAINT = 0.1  # typical strengths at which that is asked: where an effect acts has no slope at none
STAGES = ((0.5, 1.0), (0.5, 1.0, 2.0), HORIZONS)  # s
EVERY = 2.0  # s between start points
# times usual water: latent wrench of the filter that gives the states, and of the predictions
FOLLOWING, CALM = 20.0, 5.0
STRENGTH = 0.3  # typical strengths from which an effect is fitted
ROUNDS = 8  # of states and parameters, in each stage
SETTLED = 0.005  # of the cost; a round that gains less is the last, and an effect no help
FOLDS = 3


@dataclass(frozen=True)
class _Fitted:
    """A structure fitted by its predictions."""

    hypothesis: Hypothesis
    theta: Array
    cost: float


class WithoutWrench(MultistepError):
    """Prediction errors on which no latent wrench acts."""

    def start_from(self, theta: Array, noise: Noise) -> None:
        """Take the start states from the filter with theta, without its wrench."""
        super().start_from(theta, noise)
        self.estimates = replace(self.estimates, wrench=np.zeros_like(self.estimates.wrench))


def surrogate_model(
    nominal: Fit,
    names: Sequence[str],
    experiment: Experiment,
    report: Callable[[str], None],
    candidates: Sequence[str] = (),
) -> Fit:
    """The model that predicts best; nominal: the fit without effects; names: effects that may help.

    candidates: effects of which those are tried, too, that lower the predictions' cost most. The nominal fit itself where no
    trial is long enough to predict.
    """
    plain = nominal_hypothesis(nominal.hypothesis.robot, nominal.hypothesis.free)
    if not WithoutWrench(experiment, plain, EVERY).targets:
        return nominal
    noise = _water(nominal.noise, FOLLOWING)
    report("no name fits: fitting predictions over seconds")
    starts = [plain.parametrization.origin(), nominal.theta]
    best = _fitted(plain, starts, noise, experiment)
    chosen = _most_promising(best, _moving(plain, candidates), noise, experiment)
    helpful = dict.fromkeys((*_moving(plain, names), *chosen))
    for _ in range(MOST_EFFECTS):
        left = [name for name in helpful if name not in best.hypothesis.names]
        tried = on_all_cores(partial(_grown, best, noise, experiment), left)
        promising = min(tried, key=lambda one: one.cost, default=best)
        falls = best.cost - promising.cost >= SETTLED * best.cost
        if not falls or not _predicts_better(best, promising, noise, experiment):
            break
        best = promising
        report(f"predictions are better with {', '.join(best.hypothesis.names)}")
    return _best_of(best, (nominal, fit_multistep(nominal, experiment, report)), experiment)


def _moving(hypothesis: Hypothesis, names: Sequence[str]) -> list[str]:
    """Those that move the fish: a sensor's error predicts no motion."""
    return [name for name in names if name in hypothesis.robot.table]


def _most_promising(
    best: _Fitted, names: Sequence[str], noise: Noise, experiment: Experiment
) -> list[str]:
    """The CHOSEN effects whose parameters promise the largest fall of the cost each, in a Gauss-Newton step from best."""

    def fall(name: str) -> float:
        hypothesis = best.hypothesis.with_effect(name, FAINT)
        theta = extend(best.theta, hypothesis, name, FAINT)
        error = WithoutWrench(experiment, hypothesis, EVERY)
        error.start_from(theta, noise)
        return (best.cost - error.promised(theta)) / (len(theta) - len(best.theta))

    falls = dict(zip(names, on_all_cores(fall, names), strict=True))
    helpful = [name for name in names if falls[name] > 0.0]
    return sorted(helpful, key=lambda name: -falls[name])[:CHOSEN]


def _water(noise: Noise, times: float) -> Noise:
    """The noise of these sensors in water that pushes so many times as strongly as usual.

    Without gates: a filter of a wrong model that leaves out what surprises it loses the fish.
    """
    usual = Noise().with_wrench(times)
    return replace(noise.ungated(), wrench=usual.wrench, wrench_time=usual.wrench_time)


def _grown(best: _Fitted, noise: Noise, experiment: Experiment, name: str) -> _Fitted:
    """The structure with one more effect, from the start values and from its own without the effect."""
    hypothesis = best.hypothesis.with_effect(name, STRENGTH)
    origin = hypothesis.parametrization.origin()
    starts = [origin, extend(best.theta, hypothesis, name, STRENGTH)]
    return _fitted(hypothesis, starts, noise, experiment)


def _fitted(
    hypothesis: Hypothesis, starts: Sequence[Array], noise: Noise, experiment: Experiment
) -> _Fitted:
    """By predictions over longer and longer horizons, from the start that ends best."""

    def fit(theta: Array) -> _Fitted:
        for horizons in STAGES:
            error = WithoutWrench(experiment, hypothesis, EVERY, horizons)
            cost, theta = _rounds(error, theta, noise)
        return _Fitted(hypothesis, theta, cost)

    return min(on_all_cores(fit, starts), key=lambda one: one.cost)


def _rounds(error: MultistepError, theta: Array, noise: Noise) -> tuple[float, Array]:
    """(cost, theta): states and parameters in turn while the cost falls."""
    before, cost = np.inf, np.inf
    for _ in range(ROUNDS):
        cost, theta = error.improve(theta, noise, shares=(1.0,))
        if before - cost < SETTLED * before:
            break
        before = cost
    return cost, theta


def _predicts_better(before: _Fitted, after: _Fitted, noise: Noise, experiment: Experiment) -> bool:
    """Left-out trials cost less in the mean (of logarithms: no trial outweighs the others)."""

    def left_out(one: _Fitted) -> Array:
        error_on = partial(WithoutWrench, hypothesis=one.hypothesis, every=EVERY)
        return left_out_costs(error_on, one.theta, noise, experiment, FOLDS)

    without, with_it = on_all_cores(left_out, [before, after])
    return bool(np.nanmean(np.log(without / with_it)) > 0.0)


def _best_of(grown: _Fitted, others: Sequence[Fit], experiment: Experiment) -> Fit:
    """The best predictor of training trials, with predictions made as `predict` makes them: the filter's wrench decays in them.

    Where the model is right but for a force that comes and goes, a likelihood fit with that wrench predicts better than any
    structure.
    """

    def cost(fit: Fit | _Fitted, noise: Noise) -> float:
        error = MultistepError(experiment, fit.hypothesis, EVERY)
        error.start_from(fit.theta, noise)
        return float(np.nanmean(error.mean_costs(fit.theta)))

    noises = (_water(others[0].noise, CALM), others[0].noise)
    noise = min(noises, key=lambda noise: cost(grown, noise))
    best = min(others, key=lambda fit: cost(fit, fit.noise))
    if cost(best, best.noise) < cost(grown, noise):
        return best
    error = WithoutWrench(experiment, grown.hypothesis, EVERY)
    error.start_from(grown.theta, noise)
    information = error.information(grown.theta)
    fit = evaluate(grown.hypothesis, grown.theta, experiment, noise)
    return replace(fit, information=information)
