# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What counts as significant, how probable names are, and when a simpler one stands for a richer one."""

import numpy as np
import pytest
from made_fits import made_fit
from scipy.stats import norm

from fish_sysid.diagnosis.significance import (
    Level,
    evidence,
    p_value,
    p_value_unseen,
    probabilities,
    simplest,
    strength_z,
)
from fish_sysid.estimation.thresholds import TEMPER


def test_the_level_is_checked_and_falls_with_the_false_alarms():
    with pytest.raises(ValueError, match=r"false_alarms: got 0.9"):
        Level(0.9)
    assert Level(0.001).needed(100, 1, 30) > Level(0.1).needed(100, 1, 30)
    exponential = 4.0 * np.log(30 / 0.02)  # chi square of two
    assert Level(0.02).needed(0, 2, 30) == pytest.approx(exponential)
    assert Level().needed(1e6, 1, 30) == 1000.0  # a thousandth of a nat per measurement


def test_p_values_are_of_the_tempered_ratio_times_the_names_tried():
    assert p_value(5.0 * TEMPER, 2, 3) == pytest.approx(3.0 * np.exp(-5.0))
    assert p_value(-1.0, 1, 1) == 1.0
    assert p_value(0.1, 2, 30) == 1.0


def test_just_enough_on_unseen_trials_has_the_p_value_of_the_level():
    assert p_value_unseen(Level(0.01).needed_unseen(0.0, 30), 30) == pytest.approx(0.01)
    assert p_value_unseen(-5.0, 30) == 1.0


def test_probabilities_add_up_the_most_probable_first():
    fits = {
        "a": made_fit(-110.0, "current"),
        "b": made_fit(-100.0, "current"),
        "c": made_fit(-500.0, "current"),
    }
    found = probabilities(fits)
    assert list(found) == ["b", "a", "c"]
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["b"] / found["a"] == pytest.approx(np.exp(10.0 / TEMPER))
    assert probabilities({}) == {}


def test_a_parameter_that_nothing_asks_for_costs_evidence():
    sharp = np.diag([100.0, 100.0, 100.0])
    one = made_fit(-100.0, "rudder_offset", information=sharp[:2, :2])
    two = made_fit(-100.0, "current", information=sharp)
    assert evidence(one) > evidence(two) + 1.0


@pytest.mark.parametrize(
    ("best", "other", "behind", "chosen"),
    [
        ("nonuniform_current", "current", 5.0, "current"),
        ("nonuniform_current", "current", 500.0, "nonuniform_current"),
        ("nonuniform_current", "wall_effect", 5.0, "nonuniform_current"),  # something else
        ("rudder_lag", "rudder_delay", 1.0, "rudder_lag"),  # as simple
        ("current", "nonuniform_current", 1.0, "current"),  # richer
    ],
)
def test_a_simpler_look_alike_that_does_as_well_stands_for_a_richer_name(
    best, other, behind, chosen
):
    fits = {best: made_fit(900.0, best), other: made_fit(900.0 - behind, other)}
    assert simplest(best, fits, Level()) == chosen


def test_a_strength_is_as_sure_as_at_its_own_place():
    """A payload's mass times place may be known alone: its place does not blur it, another parameter does."""
    information = np.diag([4.0, 100.0, 1.0, 1.0])
    information[1, 2] = information[2, 1] = 9.999
    theta = np.array([9.0, -0.5, 3.0, 0.0])
    known = made_fit(0.0, "payload", theta=theta, information=information)
    assert known.hypothesis.free[1] == "payload.mass"
    assert strength_z(known, "payload") == pytest.approx(0.5 * 10.0)
    blurred = information.copy()
    blurred[0, 1] = blurred[1, 0] = 16.0  # correlated by 0.8 with the drag
    known = made_fit(0.0, "payload", theta=theta, information=blurred)
    assert strength_z(known, "payload") == pytest.approx(0.5 * 10.0 * 0.6)


def test_strengths_that_are_unsure_alone_may_be_sure_together():
    """Two strengths of which the data determine the sum alone; p is that of chi square with two degrees."""
    own = np.array([[100.0, 99.0], [99.0, 100.0]])
    information, theta = np.eye(3), np.array([0.0, 0.4, 0.4])
    information[1:, 1:] = own
    assert (theta[1:] / np.sqrt(np.diag(np.linalg.inv(own)))).max() < 1.0
    fit = made_fit(0.0, "current", theta=theta, information=information)
    wald = theta[1:] @ own @ theta[1:]  # exponential under the null: p = exp(-wald / 2)
    assert 2.0 * norm.sf(strength_z(fit, "current")) == pytest.approx(np.exp(-0.5 * wald))
    assert strength_z(fit, "current") > 7.0
