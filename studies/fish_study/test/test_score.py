# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an answer is worth once the label is open, by hand."""

from __future__ import annotations

import pytest
from prove_samples import diagnosis

from fish_study.scenario import Scenario
from fish_study.score import ParameterError, score_scenario

CURRENT = Scenario("single", 1, {"current": {"x": 0.03, "y": 0.0}})


def test_an_answer_is_right_exact_in_the_set_or_confidently_wrong() -> None:
    right = score_scenario(CURRENT, diagnosis(("current", "physics", 0.97), rivals=("tether",)))
    assert right.top1
    assert right.in_set
    assert right.exact
    assert not right.confident_wrong
    assert right.answered == {"current", "tether"}
    assert [p.within for p in right.parameters] == [True]  # ten standard errors, but 3 %
    wrong = score_scenario(CURRENT, diagnosis(("tether", "physics", 0.97), rivals=("current",)))
    assert not wrong.top1
    assert wrong.in_set
    assert wrong.confident_wrong
    assert wrong.false_names == ("tether",)
    nothing = score_scenario(Scenario("null", 2), diagnosis(verdict="no_mismatch"))
    assert not nothing.alarm
    assert nothing.exact
    assert not nothing.in_set
    assert not nothing.unnamed
    odd = score_scenario(
        Scenario("outside", 3, {"jet": {"x": 0.1}}), diagnosis(verdict="unexplained")
    )
    assert odd.unnamed
    assert odd.alarm
    assert not odd.truth
    pair = Scenario("two", 4, {"current": {}, "rudder_offset": {}})
    half = score_scenario(pair, diagnosis(("current", "physics", 0.6)))
    assert half.top1
    assert not half.in_set
    assert not half.exact
    lens = score_scenario(
        Scenario("sensor", 5, {"camera_scale": {}}), diagnosis(("payload", "physics", 0.99))
    )
    assert lens.called_physics


@pytest.mark.parametrize(
    ("true", "found", "std", "within"),
    [
        (0.0, 0.029, 0.01, True),
        (0.0, 0.031, 0.01, False),
        (-0.03, -0.035, 1e-4, True),
        (-0.03, -0.037, 1e-4, False),
        (-0.03, 0.03, 1e-4, False),
        (0.03, 0.03, float("nan"), True),
    ],
)
def test_a_parameter_is_right_within_three_standard_errors_or_a_fifth(
    true, found, std, within
) -> None:
    assert ParameterError("current.x", true, found, std).within is within
