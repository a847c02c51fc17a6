# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Experiments that are planned before anybody swims."""

import numpy as np
import pytest

from fish_control.excitation import Program, Row
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
from fish_sysid.design.candidate_swims import MARGIN, candidates, placed, swims_of, swims_of_program
from fish_sysid.design.detectability import detectability, vocabulary
from fish_sysid.design.sensitivity import (
    SensorSet,
    information,
    innovations,
    shown,
    signals_of_parameters,
    states,
)
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


DETECTED_FREE = ("head_drag_surge", "head_drag_sway", "head_drag_yaw", "tail_stiffness")
STRAIGHT = Program((Row(0.0, 6.0, 2.0, 0.0),), (6.0,))
TURNS = Program((Row(0.0, 6.0, 2.0, 0.5), Row(6.0, 6.0, 2.0, -0.5)), (6.0, 12.0))


def found(program, names, **sensors):
    swims = swims_of_program(program, ROBOT)
    return detectability(ROBOT, swims, names, SensorSet(**sensors), free=DETECTED_FREE)


def test_signals_of_parameters_are_the_slopes_of_which_the_information_is_made():
    hypothesis, swims = nominal_hypothesis(ROBOT, DETECTED_FREE), swims_of_program(TURNS, ROBOT)
    base = innovations(hypothesis, shown(ROBOT, swims, SensorSet()), Noise())
    J = signals_of_parameters(hypothesis, swims, SensorSet(), Noise(), base)
    expected = information(hypothesis, swims, SensorSet(), Noise()).sum(axis=0)
    assert J.T @ J == pytest.approx(expected, rel=0.05, abs=0.02 * np.abs(expected).max())
    assert np.abs(base).max() < 0.1  # the model follows its own robot


def test_a_straight_swim_says_nothing_of_the_rudder_and_turns_do():
    straight, turns = (found(p, ["rudder_gain", "rudder_lag"]) for p in (STRAIGHT, TURNS))
    assert np.isinf(straight.strength).all()
    assert (turns.strength < 1.0).all()


def test_a_rudder_offset_looks_like_a_camera_at_an_angle_more_than_like_late_images():
    turns = found(TURNS, ["rudder_offset", "camera_heading_offset", "camera_latency"])
    assert turns.alike[0, 1] > 0.3
    assert turns.alike[0, 2] < 0.1
    assert turns.telling[0, 1] > turns.telling[0, 2]
    assert np.diag(turns.alike) == pytest.approx(1.0, abs=0.02)


def test_slip_and_wake_at_the_tip_are_not_told_apart_by_a_steady_stroke():
    twins = found(STRAIGHT, ["tip_slip", "wake_memory"])
    assert twins.alike[0, 1] > 0.95
    assert (np.array([twins.telling[0, 1], twins.telling[1, 0]]) > twins.strength).all()


def test_without_an_imu_its_errors_are_not_seen_and_others_later():
    names = ["gyro_scale", "imu_latency", "rudder_gain"]
    full, blind = found(TURNS, names), found(TURNS, names, imu=0.0)
    assert np.isinf(blind.strength[:2]).all()
    assert blind.gain[2] < full.gain[2]


def test_late_images_are_seen_at_a_tenth_of_their_typical_age():
    assert found(TURNS, ["camera_latency"]).strength[0] < 0.1


def test_the_vocabulary_is_all_that_the_robot_does_not_have():
    assert "tip_slip" not in vocabulary(Robot().with_effect("tip_slip", mobility=0.1))
    assert len(vocabulary(Robot())) >= 31
    with pytest.raises(ValueError, match="unknown name 'wings'"):
        vocabulary(Robot(), ["wings"])
