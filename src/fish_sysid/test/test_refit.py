# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A refit reaches the optimum from afar with the schedule that suits, and keeps what it has where nothing is better."""

import numpy as np
import pytest
from made_fits import made_fit
from swims import fish, swim

from fish_sim.robot import Robot
from fish_sysid.diagnosis.model_order import with_links
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import better
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import (
    ANNEAL,
    ANNEAL_NEAR,
    ANNEAL_SHORT,
    REFIT,
    anneal_if_suspect,
    anneal_if_unexplained,
    best_of_restart,
    refit,
    refit_on,
)

FREE = ("head_drag_surge", "head_drag_sway", "tail_stiffness")
TRUE = np.log([1.3, 0.8, 1.1])


@pytest.fixture(scope="module")
def data():
    return swim(fish(), kinds=("sines", "steps"))


@pytest.fixture(scope="module")
def best(data):
    return refit(nominal_hypothesis(Robot(links=1), FREE), TRUE, data, Noise(), REFIT)


def test_a_fit_without_a_likelihood_is_never_the_better_one():
    lost, low = made_fit(np.nan), made_fit(-5.0)
    assert better(lost, low) is low
    assert better(low, lost) is low


def test_annealing_reaches_from_the_nominal_values_what_a_refit_reaches_from_the_truth(data, best):
    found = refit(best.hypothesis, np.zeros(3), data, Noise(), ANNEAL)
    assert found.log_posterior > best.log_posterior - 5.0
    np.testing.assert_allclose(found.theta, best.theta, atol=0.05)


def test_parameters_of_a_large_effect_keep_their_values_while_annealing(data):
    hypothesis = nominal_hypothesis(Robot(links=1), FREE).with_effect("nonuniform_current")
    theta = np.full(len(hypothesis.free), 0.05)
    found = refit(hypothesis, theta, data, Noise(), ANNEAL_SHORT)
    np.testing.assert_array_equal(found.theta[3:], theta[3:])
    assert not np.allclose(found.theta[:3], theta[:3])


def test_a_good_fit_stays(data, best):
    for keep in (anneal_if_suspect, anneal_if_unexplained):
        assert keep(best, data) is best
    assert best_of_restart(best, best.theta + 0.1, data, best.noise, REFIT) is best


def test_a_fit_is_refitted_on_other_trials(data, best):
    more = swim(fish(), kinds=("random", "turn"), seed=1)
    assert refit_on(best, more).largest_ratio < 3.0


# a step away from the optimum of a tail of five links (logarithms)
ASIDE = {
    "head_added_mass_surge": 0.093,
    "head_added_mass_sway": 0.021,
    "head_inertia": 0.018,
    "link_inertia_factor": 0.034,
    "fin_added_mass_sway": 0.085,
    "fin_inertia_factor": 0.197,
    "tail_stiffness": 0.016,
    "rotor_inertia": 0.013,
    "head_drag_surge": 0.053,
    "head_drag_yaw": 0.025,
    "link_drag_surge": 0.436,
    "fin_drag_surge": -0.582,
    "fin_drag_sway": 0.185,
}


@pytest.mark.timeout(1200)  # of a loaded computer; a minute on a quiet one
def test_a_neighbouring_optimum_of_a_fine_tail_is_left_by_annealing_nearby():
    """Its optima lie so close together that a fit ends in a neighbour of the best."""
    robot = with_links(Robot(), 5)
    calm = Noise(gyro=0.003, accel=0.025, camera_position=0.001, camera_heading=0.006)
    swum = swim(robot, kinds=("sines", "random"), duration=6.0, seed=2, noise=calm)
    hypothesis, noise = nominal_hypothesis(robot), usual_noise(swum)
    truth = hypothesis.parametrization.origin()
    aside = truth + [ASIDE.get(name, 0.0) for name in hypothesis.free]
    stuck = refit(hypothesis, aside, swum, noise, REFIT)
    found = better(stuck, refit(hypothesis, stuck.theta, swum, noise, ANNEAL_NEAR))
    best = refit(hypothesis, truth, swum, found.noise, REFIT)
    assert best.log_posterior - stuck.log_posterior > 100.0
    assert abs(found.log_posterior - best.log_posterior) < 3.0
