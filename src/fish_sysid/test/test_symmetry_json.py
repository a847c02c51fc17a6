# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the answer and the sentence say of symmetry findings, beside what the search names."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fish_report.json_file import plain
from fish_sim.effects import EFFECTS
from fish_sysid.diagnosis.symmetry.finding import Estimate, Evidence, SymmetryFinding
from fish_sysid.diagnosis.symmetry.symmetry_json import stated, symmetry_entry, with_symmetry
from fish_sysid.reports.diagnosis_page import symmetry_table
from fish_sysid.reports.verdict_sentence import sentence

FLOW = SymmetryFinding(
    "current",
    "physics",
    "found",
    "a steady flow",
    "several headings",
    statement="the water moves by (0.030 ± 0.003, -0.020 ± 0.001) m/s",
    parameters={"x": Estimate(0.03, 0.003, "m/s"), "y": Estimate(-0.02, 0.001, "m/s")},
    evidence=Evidence(0.7, 0.1, 1e-5),
)
BLIND = SymmetryFinding(
    "gyro_scale", "sensor", "cannot tell", "a", "b", reason="no gyro was recorded"
)


def by_search(name: str) -> dict:
    return {
        "name": name,
        "evidence": {
            "basis": "likelihood",
            "log_likelihood_gain": 90.0,
            "p_value": 0.0,
            "probability": 0.97,
        },
        "parameters": {"x": {"value": 0.028, "std": 0.001, "unit": "m/s"}},
        "rivals": [],
    }


def test_a_finding_that_the_search_does_not_name_is_an_effect_by_symmetry():
    (effect,) = with_symmetry([], (FLOW, BLIND), EFFECTS)
    assert effect["name"] == "current"
    assert effect["kind"] == "physics"
    assert effect["equation"] == EFFECTS["current"].equation
    assert effect["evidence"]["basis"] == "symmetry"
    assert effect["evidence"]["left_out_log_gain"] == 0.7
    assert effect["evidence"]["p_value"] == 1e-5
    assert effect["parameters"]["y"] == {"value": -0.02, "std": 0.001, "unit": "m/s"}
    assert plain(effect)["share"] is None  # only a model of the fish tells


@pytest.mark.parametrize("name", ["current", "nonuniform_current"])
def test_what_the_search_names_keeps_its_numbers_and_gets_those_of_the_symmetry(name):
    """A flow that varies has a mean: it is the same finding."""
    (effect,) = with_symmetry([by_search(name)], (FLOW,), EFFECTS)
    assert effect["evidence"]["basis"] == "likelihood"
    assert effect["evidence"]["probability"] == 0.97
    assert effect["parameters"]["x"]["value"] == 0.028
    assert effect["evidence"]["symmetry"]["parameters"]["x"]["value"] == 0.03


def test_without_findings_the_effects_of_the_search_stay_as_they_are():
    before = by_search("tip_slip")
    (after,) = with_symmetry([before], (replace(FLOW, status="not found"), BLIND), EFFECTS)
    assert after == {**before, "evidence": {**before["evidence"], "basis": "likelihood"}}


def test_only_names_of_the_vocabulary_that_stand_alone_are_stated():
    described = replace(FLOW, name="slower or faster in a part of the pool")
    assert stated([described, replace(FLOW, stands_alone=False), BLIND]) == []
    varying = replace(FLOW, name="nonuniform_current")
    assert [f.name for f in stated([FLOW, varying])] == ["nonuniform_current"]


def content(effects: list[dict]) -> dict:
    return {
        "verdict": "unexplained",
        "effects": effects,
        "unexplained": {"description": "yaw = (0.001) cos(heading)", "nearest": []},
        "fit": {"tail_links": {"given": 3, "used": 3}, "held_out_trials": ["a"]},
    }


def test_the_sentence_says_what_symmetry_finds_and_what_is_left():
    assert sentence(content(with_symmetry([], (FLOW,), EFFECTS))) == (
        "The water moves by (0.030 ± 0.003, -0.020 ± 0.001) m/s; beside that "
        "unexplained: yaw = (0.001) cos(heading)."
    )
    named = content(with_symmetry([by_search("current")], (FLOW,), EFFECTS))
    assert sentence({**named, "verdict": "missing_physics"}) == (
        "missing_physics: the model lacks current (x 0.028 ± 0.001 m/s; probability 0.97)."
    )


def test_the_page_shows_every_test_with_what_it_assumes_and_needs():
    table = symmetry_table(symmetry_entry((FLOW, BLIND)))
    assert table.rows[0][:4] == [
        "current",
        "found",
        "x 0.03 ± 0.003 m/s, y -0.02 ± 0.001 m/s",
        "0.70 ± 0.10",
    ]
    assert table.rows[1] == ["gyro_scale", "cannot tell: no gyro was recorded", "", "", "a", "b"]
