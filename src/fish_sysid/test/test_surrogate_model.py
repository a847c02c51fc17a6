# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The robot to go on with where no name fits: it predicts better, by effects that help and no others."""

from __future__ import annotations

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment, shorten
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.prediction_rivals import with_rivals
from fish_sysid.diagnosis.surrogate_model import moving_effects, surrogate_model
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit, evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.shooting.left_out import Step
from fish_sysid.estimation.shooting.schedule import Found
from fish_sysid.prediction.prediction import prediction_size

FREE = ("head_drag_surge", "head_drag_yaw", "tail_stiffness")
WATER = Noise(wrench=(0.002, 0.004, 1e-4))
NOMINAL = Robot(links=2)
SLIPPING = NOMINAL.with_parameters(head_drag_surge=0.26).with_effect("tip_slip", mobility=0.3)
KINDS = ("sines", "random", "steps", "turn")


def recorded(robot: Robot, seed: int) -> Experiment:
    random = np.random.default_rng(seed)
    commands = np.stack([program(kind, 9.0, random) for kind in KINDS], axis=1)
    return record(robot, commands, WATER, random)[0]


@pytest.fixture(scope="module")
def slipping() -> Experiment:
    return recorded(SLIPPING, 4)


def nominal(experiment: Experiment) -> Fit:
    """Of a likelihood that was content with what it got."""
    hypothesis = nominal_hypothesis(NOMINAL, FREE)
    return evaluate(hypothesis, np.zeros(len(FREE)), experiment, Noise(wrench=(0.1, 0.2, 0.01)))


@pytest.mark.timeout(600)
def test_what_helps_is_taken_and_unseen_trials_are_predicted(slipping: Experiment) -> None:
    """A sensor's error moves no fish, and is not tried."""
    start = nominal(slipping)
    names = ("camera_scale", "tip_slip", "tail_joint_damping")
    found, (asked,) = surrogate_model(start, names, slipping, lambda _: None)
    assert asked.step.name == "tip_slip"
    assert asked.step.gain > 2.0 * asked.step.deviation
    assert asked.step.p_value < 0.05
    assert not asked.rivals  # damped joints do not do as well in its place
    assert "tip_slip" in found.hypothesis.names
    assert "camera_scale" not in found.hypothesis.names
    assert found.values["tip_slip.mobility"] == pytest.approx(0.3, rel=0.15)
    assert found.values["head_drag_surge"] == pytest.approx(0.26, rel=0.1)
    unseen = recorded(SLIPPING, 5)
    before = prediction_size(unseen, start.robot, start.noise)
    # nine errors: position, heading and speed at three horizons, each at most half as large
    assert prediction_size(unseen, found.robot, found.noise) < before - 9.0 * np.log(2.0)


def test_what_the_robot_has_from_the_symmetries_is_no_candidate() -> None:
    drifting = NOMINAL.with_effect("current", x=0.03, y=0.0)
    names = ("current", "tip_slip", "camera_latency")
    assert moving_effects(names, drifting) == ["tip_slip"]
    assert moving_effects(names, NOMINAL) == ["current", "tip_slip"]


def test_an_effect_that_was_added_in_a_later_round_is_nobodys_rival(slipping: Experiment) -> None:
    steps = (
        Step("quadratic_drag", 0.3, 0.1, 2.0, added=True),
        Step("wave_drag", 0.1, 0.1, 2.0),
        Step("wave_drag", 0.3, 0.1, 2.0, added=True),
    )
    found = Found(nominal(slipping).hypothesis, np.zeros(len(FREE)), np.inf)
    named = with_rivals(slipping, found, steps)
    assert [(n.step.name, n.rivals) for n in named] == [("quadratic_drag", {}), ("wave_drag", {})]


def test_a_fit_that_predicts_better_stays(slipping: Experiment) -> None:
    hypothesis = nominal_hypothesis(SLIPPING, FREE)
    true = evaluate(hypothesis, np.zeros(len(FREE)), slipping, WATER)
    found, asked = surrogate_model(true, (), slipping, lambda _: None)
    assert not asked
    sizes = [prediction_size(slipping, fit.robot, fit.noise) for fit in (found, true)]
    assert sizes[0] <= sizes[1]
    assert found.values["head_drag_surge"] == pytest.approx(0.26, rel=0.1)


def test_trials_too_short_to_predict_leave_the_fit_as_it_is(slipping: Experiment) -> None:
    start = nominal(short := shorten(slipping, 150))
    assert surrogate_model(start, ("tip_slip",), short, lambda _: None) == (start, ())
