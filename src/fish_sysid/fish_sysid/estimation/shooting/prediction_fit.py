# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A robot fitted to what it shall predict: number of links, starts, effects, polish, errors clustered by trial, and bands.

How far off a prediction may be is what its parameters leave open, and what the model misses in trials left out:

    band^2 = t^2 (J C J' + s^2)

J: slope of the predicted stroke mean; C: covariance clustered by trial; s: robust spread of the training trials' errors at the
same horizon, each fold of trials predicted by the parameters without it; t: 97.5 % quantile of Student's t with M - 1 degrees of
freedom, as M training trials say how far trials differ. The first term alone would be the band of a model that is right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from fish_sim.model import DT
from fish_sim.robot import Robot, nominal_parameters
from fish_sysid.dataset.camera import AHEAD, MARKER
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.parametrization import Hypothesis, nominal_hypothesis
from fish_sysid.estimation.shooting.least_squares import (
    clustered_covariance,
    scores_by_trial,
    weight,
)
from fish_sysid.estimation.shooting.left_out import (
    EVERY,
    FOLDS,
    Step,
    fold_of,
    judged,
    left_out_costs,
    without_folds,
)
from fish_sysid.estimation.shooting.multistep import Multistep
from fish_sysid.estimation.shooting.residuals import SENSOR_SCALE, SENSORS
from fish_sysid.estimation.shooting.rollout import ShotParametrization
from fish_sysid.estimation.shooting.schedule import (
    FINE,
    Found,
    best_start,
    multistep,
    polished,
    trusted,
)
from fish_sysid.estimation.shooting.selection import (
    GLANCE,
    RANGE,
    choose,
    eliminate,
    judged_end,
    with_end,
    without_false_end,
)

Array = NDArray[np.float64]
Report = Callable[[str], None]

LINKS = (2, 1, 3)  # numbers of links in the order that they are tried in
MOST_STARTS, QUICK_ROUNDS = 120, 2  # of a quick fit
HELD = ("servo_rate_limit",)  # takes the place of any delay of the rudder
PLACE = f"{MARKER}.{AHEAD}"  # of the camera's point
IMU_CLOCK = "imu_latency.delay"  # free in windows alone: predictions hardly feel it
NORMAL = 1.96  # standard deviations on both sides that hold 95 % of a normal distribution


@dataclass(frozen=True)
class PredictionFit:
    """What came out."""

    found: Found
    steps: tuple[Step, ...]  # every effect that was judged
    covariance: Array  # (P, P) of z, clustered by trial
    spread: Array  # (P,) standard deviation of z over fits without a fold each, times the jackknife's factor
    links_judged: tuple[Step, ...]  # every other number of links that was judged

    @property
    def robot(self) -> Robot:
        """The robot at the optimum, without the sensors' parameters."""
        return ShotParametrization(self.found.hypothesis).robot(self.theta)

    @property
    def theta(self) -> Array:
        """The free parameters (K,)."""
        return self.found.z[: -len(SENSORS)]

    @property
    def sensors(self) -> dict[str, float]:
        """Ages of images and IMU samples beyond what was taken out before [s], the camera's heading offset and point [rad, m]."""
        values = self.found.z[-len(SENSORS) :] * SENSOR_SCALE
        values[1] += values[0]  # the IMU's counts from the camera's
        return dict(zip(SENSORS, values.tolist(), strict=True))

    @property
    def sensor_errors(self) -> dict[str, float]:
        """Standard errors of `sensors`."""
        deviation = np.sqrt(np.diag(self.covariance))[-len(SENSORS) :] * SENSOR_SCALE
        return dict(zip(SENSORS, deviation.tolist(), strict=True))

    @property
    def parameter_spread(self) -> dict[str, float]:
        """Spread over folds of the physical values, to first order."""
        slope = np.abs(ShotParametrization(self.found.hypothesis).slope(self.theta))
        spread = self.spread[: len(slope)] * slope
        return dict(zip(self.found.hypothesis.free, spread.tolist(), strict=True))

    def with_camera(self) -> tuple[Hypothesis, Array, Array]:
        """(hypothesis, theta (K,), covariance (K, K)), the camera's point and heading offset among the robot's sensors."""
        hypothesis, K = self.found.hypothesis, len(self.theta)
        robot = ShotParametrization(hypothesis).robot(self.theta)
        offset = self.sensors["camera_heading_offset.offset"]
        camera = {
            "camera_heading_offset": {"offset": offset},
            MARKER: {AHEAD: self.sensors[PLACE]},
        }
        settled = replace(hypothesis.robot, sensors={**robot.sensors, **camera})
        return replace(hypothesis, robot=settled), self.theta, self.covariance[:K, :K]


def with_links(robot: Robot, links: int) -> Robot:
    """The same fish with its tail cut into another number of equal links: totals and ratios to nominal values stay."""
    if links == robot.links:
        return robot
    before, after = nominal_parameters(robot.links), nominal_parameters(links)
    values = {
        name: after[name].value * value / before[name].value
        for name, value in robot.parameters.items()
    }
    return replace(robot, links=links, parameters=values)


def prediction_hypothesis(
    robot: Robot, experiment: Experiment, free: Sequence[str], effects: Sequence[str], start: float
) -> Hypothesis:
    """The robot with its parameters free but the servo's rate; without an end of the rudder where commands go beyond it."""
    moved = tuple(name for name in free if name not in HELD)
    hypothesis = nominal_hypothesis(without_false_end(robot, experiment), moved)
    for name in effects:
        hypothesis = hypothesis.with_effect(name, start)
    return hypothesis


def fit_predictions(
    experiment: Experiment,
    robot: Robot,
    free: Sequence[str],
    effects: Sequence[str] = (),
    choose_from: Sequence[str] = (),
    report: Report = lambda _: None,
    links: Sequence[int] = LINKS,
    start: float = 0.3,
    together: Sequence[str] = (),
) -> PredictionFit:
    """The robot that predicts these trials best, with `effects` and those of `choose_from` that left-out trials ask for.

    links: numbers of links; the first is fitted, the others must predict left-out trials better.
    together: those of `choose_from` that are fitted from the start and must then earn their place; the others must earn it one
    after the other. start: strength in typical ones, at which the fit of `effects` and `together` starts.
    """
    first, *others = links
    at_once = [name for name in together if name in choose_from and name not in effects]
    begun = (*effects, *at_once)
    hypothesis = prediction_hypothesis(with_links(robot, first), experiment, free, begun, start)
    found = best_start(experiment, hypothesis, report)
    report("trust in the sensors at start points")
    found, steps = judged_end(experiment, trusted(experiment, found, EVERY), report)
    if choose_from:
        found, kept = eliminate(experiment, found, at_once, report)
        rest = [name for name in choose_from if name not in at_once]
        found, added = choose(experiment, found, rest, report)
        steps = (*steps, *kept, *added)
    found, judged = other_links(experiment, found, robot, free, others, report)
    report("predictions over 0.5 to 5 s, last steps")
    found = polished(experiment, trusted(experiment, polished(experiment, found)))
    report("standard errors")
    covariance, spread = uncertainty(experiment, found)
    return PredictionFit(found, steps, covariance, spread, judged)


def quick_robot(experiment: Experiment, robot: Robot, free: Sequence[str]) -> Robot:
    """A robot that predicts these trials nearly as well as that of `fit_predictions` does, at a third of its cost.

    One round of trust and of predictions, from at most MOST_STARTS start points; the number of links stays as it is, and
    nothing is known of errors.
    """
    hypothesis = prediction_hypothesis(robot, experiment, free, (), 0.3)
    found = trusted(experiment, best_start(experiment, hypothesis), EVERY)
    seconds = DT * float(experiment.steps.sum())
    found = polished(experiment, found, max(FINE, seconds / MOST_STARTS), QUICK_ROUNDS)
    return ShotParametrization(found.hypothesis).robot(found.z[: -len(SENSORS)])


def other_links(
    experiment: Experiment,
    found: Found,
    robot: Robot,
    free: Sequence[str],
    others: Sequence[int],
    report: Report = lambda _: None,
) -> tuple[Found, tuple[Step, ...]]:
    """(the fit, or one of other numbers of links that trials left out ask for, what was judged).

    Only neighbours are tried: where one link is better than two, three are not asked.
    """
    steps: list[Step] = []
    if len(experiment.names) < FOLDS:
        return found, ()
    for count in others:
        if abs(count - found.hypothesis.robot.links) > 1:
            continue
        found, control = left_out_costs(experiment, found)
        names = tuple(
            name for name in found.hypothesis.names if name in found.hypothesis.robot.table
        )
        hypothesis = prediction_hypothesis(
            with_links(robot, count), experiment, free, names, GLANCE
        )
        if RANGE in found.hypothesis.free:
            hypothesis = with_end(hypothesis, found.hypothesis.robot.parameters[RANGE])
        other = replace(best_start(experiment, hypothesis, report), trust=found.trust)
        report(f"{count} links: leaving trials out")
        other, costs = left_out_costs(experiment, other)
        step = judged(f"{count} links", control, costs)
        better = step.sure
        steps.append(replace(step, added=better))
        if better:
            found = other
    return found, tuple(steps)


def uncertainty(experiment: Experiment, found: Found) -> tuple[Array, Array]:
    """(covariance (P, P) clustered by trial, spread (P,) over folds) of z.

    The folds' fits are one Gauss-Newton step from the optimum, without a fold's trials each; the spread is the jackknife's. One
    trial is one fold, whose spread is NaN.
    """
    cost = multistep(experiment, found)
    states = cost.states(found.z)
    e, J = cost.errors(found.z, states, slopes=True)
    _, normal = cost.normal(found.z, e, J)
    flat, rows = e.ravel(), J.reshape(e.size, -1)
    trial = np.repeat(cost.targets.trial, e.shape[1])
    scores = scores_by_trial(flat, weight(flat), rows, trial)
    moved = without_folds(cost, found.z, states)
    count = len(moved) if len(moved) > 1 else np.nan
    spread = np.sqrt((count - 1) / count * np.sum((moved - moved.mean(axis=0)) ** 2, axis=0))
    return clustered_covariance(scores, normal, cost.prior), spread


def missed(training: Multistep, z: Array) -> dict[float, Array]:
    """Horizon -> (4,) spread of scaled errors on trials left out, by the quantile that a 95 % band needs."""
    states, horizon = training.states(z), training.targets.horizon
    fold = fold_of(len(training.experiment.names))[training.targets.trial]
    e = np.empty((len(fold), 4))
    for f, without in enumerate(without_folds(training, z, states)):
        e[fold == f] = training.errors(without, states)[0][fold == f]
    return {
        float(h): np.quantile(np.abs(e[horizon == h]), 0.95, axis=0) / NORMAL
        for h in np.unique(horizon)
    }


def inside(
    training: Multistep, unseen: Multistep, z: Array, covariance: Array, horizon: float
) -> NDArray[np.bool_]:
    """(R, 4) whether each error of unseen trials at a horizon [s] lies in its 95 % band: x, y, heading, speed."""
    e, J = unseen.errors(z, unseen.states(z), slopes=True)
    rows = unseen.targets.horizon == horizon
    e, J = e[rows], J[rows]
    open_left = np.einsum("rip,pq,riq->ri", J, covariance, J)
    trials = len(training.experiment.names)
    band = t.ppf(0.975, trials - 1) * np.sqrt(open_left + missed(training, z)[horizon] ** 2)
    return np.asarray(np.abs(e) <= band)
