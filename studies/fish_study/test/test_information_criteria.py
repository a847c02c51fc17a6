# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""AIC, BIC and the held-out error as competitors, by hand."""

from __future__ import annotations

from dataclasses import replace
from math import log

import pytest
from prove_samples import answered, diagnosis, failed

from fish_study.information_criteria import (
    aic_cost,
    bic_cost,
    choice,
    criterion_table,
    smallest_error,
)
from fish_study.scenario import Scenario
from fish_study.score import score_scenario

CURRENT = Scenario("single", 1, {"current": {"x": 0.03, "y": 0.0}})


def test_rivals_of_the_tool_choose_by_penalised_gain_or_held_out_error() -> None:
    right = score_scenario(CURRENT, diagnosis(("current", "physics", 0.97)))
    assert choice(right, lambda name, _: 3.0 if name == "quadratic_drag" else 1.0) == "current"
    assert choice(right, lambda *_: 20.0) is None
    assert smallest_error(right) == "wall_effect"
    assert smallest_error(replace(right, held_out={"current": 0.011})) is None
    lost = diagnosis(("current", "physics", 0.97))  # what is not finite is null in the file
    lost["diagnosis"]["ranking"][1]["gain"] = None
    lost["diagnosis"]["refitted"][1]["held_out_rms"]["2 s"]["position_m"] = None
    assert choice(score_scenario(CURRENT, lost), lambda *_: 1.0) == "current"
    lost["diagnosis"]["fit"]["refitted"]["rms"]["2 s"]["position_m"] = None
    assert smallest_error(score_scenario(CURRENT, lost)) == "current"


def test_a_scenario_without_an_answer_is_right_for_no_method() -> None:
    scores = [
        answered("single", ("current",), "current"),
        failed("single", "current"),
        answered("null", (), verdict="no_mismatch"),
        failed("null"),
    ]
    rows = {
        row[0]: [cell.split(" =")[0] for cell in row[1:]] for row in criterion_table(scores).rows
    }
    assert rows["this tool"] == ["1/2", "0/1"]
    assert all(right.endswith("/2") and alarms.endswith("/1") for right, alarms in rows.values())
    assert choice(scores[1], lambda *_: 0.0) is None
    assert smallest_error(scores[1]) is None


def test_information_criteria_cost_as_in_their_definitions() -> None:
    """Half of 2 k and half of k ln n: a current has two numbers; n counts what the ranking sees of training trials."""
    for count, duration, seen in ((3, 6.0, 2 * 6), (9, 12.0, 4 * 8)):
        for encoder, imu_and_encoder in ((True, 4), (False, 3)):
            scenario = replace(CURRENT, count=count, duration=duration, encoder=encoder)
            score = score_scenario(scenario, diagnosis())
            measured = seen * (100 * imu_and_encoder + 30 * 3)
            assert bic_cost("current", score) == pytest.approx(0.5 * 2 * log(measured))
            assert aic_cost("current", score) == 2.0


def test_a_name_costs_the_numbers_that_it_took_in_its_answer() -> None:
    """`nonuniform_current` has had 11, 17 and 37."""
    result = diagnosis()
    result["diagnosis"]["ranking"][0]["free_parameters"] = 17
    score = score_scenario(CURRENT, result)
    assert aic_cost("current", score) == 17.0
    assert (
        aic_cost("quadratic_drag", score)
        == aic_cost("quadratic_drag", replace(score, free={}))
        > 0.0
    )


def test_competitors_are_judged_on_scenarios_with_one_name_and_on_nulls() -> None:
    single = answered("single", ("current",), "tether")
    found = replace(
        single, ranking={"current": 30.0, "quadratic_drag": 20.0}, held_out={"current": 0.009}
    )
    calm = replace(
        answered("null", (), verdict="no_mismatch"),
        ranking={"current": 4.0},
        held_out={"current": 0.02},
    )
    silent = answered(
        "null", (), verdict="no_mismatch"
    )  # no name was refitted: the held-out error had no choice
    silent = replace(silent, ranking={"current": 1.0}, held_out={})
    others = [
        silent,
        answered("outside", ("jet",)),
        answered("two", ("current", "tip_slip")),
        failed("null"),
    ]
    rows = criterion_table([found, calm, *others]).rows
    assert [[row[0], *(cell.split(" =")[0] for cell in row[1:])] for row in rows] == [
        ["this tool", "0/1", "0/2"],
        ["AIC", "1/1", "1/2"],  # 4 nats for two numbers
        ["BIC", "1/1", "0/2"],
        ["smallest held-out error", "1/1", "0/1"],
    ]
