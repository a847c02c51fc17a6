# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A global fit reaches the optimum of the truth where one way from the nominal values ends in a poor one."""

from dataclasses import replace

import numpy as np
from swims import swim

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.diagnosis.model_order import with_links
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate, likelihoods
from fish_sysid.estimation.noise_estimation import Reach, estimate_noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE, Hypothesis, nominal_hypothesis
from fish_sysid.estimation.refit import ANNEAL, REFIT, global_fit, multistart_fit, refit
from fish_sysid.estimation.thresholds import SHORTEST_WRENCH


def recorded(links: int, seed: int) -> tuple[Hypothesis, Experiment, Fit]:
    """The nominal hypothesis, two trials of a fish up to 25 % away from it, and the fit from the truth."""
    random = np.random.default_rng(seed)
    robot = with_links(Robot(), links)
    ratios = random.uniform(0.75, 1.25, len(NOMINAL_FREE))
    ratios[NOMINAL_FREE.index("servo_rate_limit")] = 1.0
    values = {n: robot.parameters[n] * r for n, r in zip(NOMINAL_FREE, ratios, strict=True)}
    data = swim(robot.with_parameters(**values), kinds=("sines", "steps"), duration=4.0, seed=seed)
    hypothesis = nominal_hypothesis(robot)
    return hypothesis, data, refit(hypothesis, np.log(ratios), data, Noise(), REFIT)


def test_a_tail_of_one_link_is_fitted_as_well_as_from_the_truth() -> None:
    hypothesis, data, true = recorded(1, 0)
    assert global_fit(hypothesis, data, Noise()).log_posterior > true.log_posterior - 3.0


def test_many_starts_reach_the_truth_of_a_tail_of_three_links_where_one_does_not() -> None:
    hypothesis, data, true = recorded(3, 0)
    origin = hypothesis.parametrization.origin()
    single = refit(hypothesis, origin, data, Noise(), ANNEAL)
    found = multistart_fit(hypothesis, data, Noise())
    assert found.log_posterior > single.log_posterior + 100.0
    assert found.log_posterior > true.log_posterior - 3.0


def test_a_given_place_is_one_of_the_starts() -> None:
    """The stiffness is twenty times the nominal one, where no random start comes near."""
    stiff = Robot(links=1)
    stiff = stiff.with_parameters(tail_stiffness=20.0 * stiff.parameters["tail_stiffness"])
    data = swim(stiff, kinds=("sines", "steps"), duration=3.0)
    hypothesis = nominal_hypothesis(Robot(links=1), ("tail_stiffness",))
    place = np.log([20.0])
    found = multistart_fit(hypothesis, data, Noise(), places=[place])
    right = evaluate(hypothesis, place, data, Noise()).log_posterior
    assert found.log_posterior > right - 10.0
    assert multistart_fit(hypothesis, data, Noise()).log_posterior < right - 20.0


def test_a_slow_strong_force_is_found_from_a_fast_one() -> None:
    """The fish lies in a current that the model has not."""
    flow = {"mean_x": 0.0, "mean_y": 0.0, "strain": 0.05, "shear_x": 0.2, "shear_y": 0.1}
    robot = Robot(links=1).with_effect("nonuniform_current", **flow)
    data = swim(robot, kinds=("sines", "random"), seed=5)
    hypothesis = nominal_hypothesis(Robot(links=1))
    fast = replace(Noise().with_wrench(30.0), wrench_time=SHORTEST_WRENCH)
    slow = replace(Noise().with_wrench(16.0), wrench_time=2.0)
    fit = evaluate(hypothesis, np.zeros(len(hypothesis.free)), data, fast)
    found = estimate_noise(fit, data, reach=Reach.ANYWHERE)
    of_found, of_slow, of_fast = likelihoods(hypothesis, fit.theta, data, [found, slow, fast])
    assert of_found > of_slow > of_fast + 100.0
