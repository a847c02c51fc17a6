# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from fish_report.errors import UserError
from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import record
from fish_sysid.design.calibration_plan import (
    plan_calibration,
    reachable,
    robots_like,
    shortest_possible,
    shortest_set,
    standard_errors,
)
from fish_sysid.design.candidate_swims import MARGIN, candidates, placed, swims_of
from fish_sysid.design.sensitivity import SensorSet, states
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.refit import REFIT, refit

ROBOT = Robot(links=1)
FREE = (
    "head_added_mass_sway",
    "tail_stiffness",
    "rotor_inertia",
    "head_drag_surge",
    "head_drag_yaw",
)
FEW = [c for c in candidates() if c.length == 6.0][::5]
ERROR = 0.02


@pytest.fixture(scope="module")
def plan():
    return plan_calibration(ROBOT, error=ERROR, free=FREE, robots=2, choose_from=FEW)


def test_a_swum_plan_determines_the_parameters_to_the_stated_errors(plan):
    assert (plan.expected <= plan.wanted).all()
    hypothesis, random = nominal_hypothesis(ROBOT, FREE), np.random.default_rng(3)
    scores, stated = [], []
    for truth in robots_like(ROBOT, FREE, 4, seed=1)[1:]:
        experiment, _ = record(truth, swims_of(list(plan.swims)).commands, Noise(), random)
        start = hypothesis.parametrization.origin()
        fit = refit(hypothesis, start, experiment, usual_noise(experiment), REFIT)
        true = hypothesis.parametrization.encode(np.array([truth.parameters[n] for n in FREE]))
        stated.append(np.sqrt(np.diag(fit.covariance)))
        scores.append((fit.theta - true) / plan.expected)
    assert np.max(stated) < 1.5 * ERROR  # recordings are noisy, and the truth is another robot
    assert np.sqrt(np.mean(np.square(scores))) < 1.5
    assert np.max(np.abs(scores)) < 4.0


def test_the_swims_of_a_plan_stay_in_the_pool_by_the_model(plan):
    way = states(ROBOT, swims_of(list(plan.swims), plan.start))[..., :2]
    assert np.abs(way[..., 0]).max() <= 2.135 - MARGIN + 1e-6
    assert np.abs(way[..., 1]).max() <= 1.065 - MARGIN + 1e-6


def test_a_swim_that_needs_more_room_than_the_pool_has_is_no_candidate():
    straight = [c for c in candidates() if c.what == "11.5 rad at 2 Hz, straight"]
    kept, swims = placed(straight, ROBOT)
    assert 0 < len(kept) < len(straight)
    assert len(swims.start) == len(kept)


def test_errors_beyond_reach_are_said_with_what_can_be_reached():
    with pytest.raises(UserError, match=r"head_drag_yaw 0\.\d+ %"):
        plan_calibration(ROBOT, error=1e-6, free=FREE, robots=1, choose_from=FEW[:4])


def test_a_plan_without_an_imu_is_longer(plan):
    blind = plan_calibration(
        ROBOT, SensorSet(imu=0.0), error=ERROR, free=FREE, robots=2, choose_from=FEW
    )
    assert blind.seconds > plan.seconds


def test_the_program_of_a_plan_ends_each_swim_where_the_swim_ends(plan):
    program = plan.program
    assert program.duration == sum(swim.length for swim in plan.swims)
    assert program.end_of_swim(0.0) == plan.swims[0].length


def test_the_shortest_set_takes_the_swim_that_says_most_for_its_time():
    # swim 0: both parameters, 10 s; swims 1 and 2: one each as well, 1 s; swim 3: nothing
    rows = [np.diag(d) for d in ((100.0, 100.0), (100.0, 0.0), (0.0, 100.0), (0.0, 0.0))]
    information, seconds = np.array(rows)[None], np.array([10.0, 1.0, 1.0, 1.0])
    prior, wanted = np.full(2, 10.0), np.full(2, 0.1001)
    counts = shortest_set(information, seconds, prior, wanted)
    assert counts.tolist() == [0, 1, 1, 0]
    assert (standard_errors(information, counts, prior) <= wanted).all()
    assert reachable(information, prior) == pytest.approx(np.full(2, 1.0 / np.sqrt(600.01)))
    # a share of swims 1 and 2 suffices
    assert shortest_possible(information, seconds, prior, wanted) == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("error", [0.0, -0.1, np.nan, np.inf])
def test_an_error_that_is_no_share_is_refused(error: float) -> None:
    with pytest.raises(UserError, match="expected a share above 0"):
        plan_calibration(Robot(), error=error)
