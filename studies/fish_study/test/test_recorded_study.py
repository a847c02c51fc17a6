# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The newest study's file: complete, as it was committed to, made again from its seeds, and the page shows its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from fish_study.archive import opened_studies
from fish_study.markdown import generated_part, write_generated_part
from fish_study.recorded_comparison import Comparison, comparison_tables, recorded_answers
from fish_study.results_page import results_text
from fish_study.scenario_groups import GROUPS, PAIRS_OF_DAYS, draw_scenarios
from fish_study.study import Study

ROOT = Path(__file__).parents[3]
ARCHIVE = ROOT / "studies" / "data" / "blind_study_26.tar.xz"
RECORDED = set(GROUPS) - set(PAIRS_OF_DAYS)


@pytest.fixture(scope="module")
def parts() -> Iterator[list[Study]]:
    with opened_studies([ARCHIVE]) as studies:
        yield studies


def test_every_label_is_the_one_committed_to_and_every_answer_is_there(parts: list[Study]) -> None:
    opened = [part.open_labels() for part in parts]  # checks every commitment
    assert sum(map(len, opened)) == 305
    assert {s.group for labels in opened for s in labels.values()} == RECORDED
    assert all(set(part.results) == set(labels) for part, labels in zip(parts, opened, strict=True))


def test_the_scenarios_of_every_part_are_drawn_again_from_its_seed(parts: list[Study]) -> None:
    """So recordings can be made again from the seed alone; recordings themselves follow from the scenario's own seed."""
    for part in parts:
        about = part.about
        drawn = draw_scenarios(about["scenarios"], about["groups"], about["seed"])
        drawn = [replace(s, count=about["trials"], duration=about["duration"]) for s in drawn]
        assert drawn == list(part.scenarios.values())


def test_the_page_shows_what_the_file_gives() -> None:
    page = ROOT / "docs" / "results" / "blind_studies.md"
    assert generated_part(page) == results_text(ARCHIVE), (
        "run python studies/write_blind_studies_page.py"
    )


def test_a_page_without_marks_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("nothing generated")
    with pytest.raises(ValueError, match="expected one line"):
        write_generated_part(page, "text")


def test_recorded_answers_are_the_same_as_themselves_and_not_as_others(parts: list[Study]) -> None:
    recorded = recorded_answers(parts)
    assert len(recorded) == len({r.name for r in recorded}) == 305
    assert {r.scenario.group for r in recorded[: len(RECORDED)]} == RECORDED
    groups, scenarios = comparison_tables([Comparison(r, r.result) for r in recorded])
    *_, everything = groups.rows
    assert everything[:4] == ["all", "305", "305/305", "305/305"]
    same, named = everything[4].split("/")
    assert same == named
    assert len(scenarios.rows) == 305
    one = next(r for r in recorded if r.scenario.group == "single")
    silent = {"seconds": 9.0, "diagnosis": None, "error": "exit status 1"}
    other = Comparison(one, silent)
    assert not other.same_verdict
    assert not other.same_names
    assert comparison_tables([other])[0].rows[-1][2:5] == ["0/1", "0/1", "–"]


def test_a_parameter_is_compared_in_recorded_standard_errors(parts: list[Study]) -> None:
    one = next(r for r in recorded_answers(parts) if r.scenario.group == "sensor")
    ((name, parameters),) = (
        (e["name"], e["parameters"]) for e in one.result["diagnosis"]["effects"]
    )
    moved = {k: {**p, "value": p["value"] + 2.5 * p["std"]} for k, p in parameters.items()}
    diagnosis = {**one.result["diagnosis"], "effects": [{"name": name, "parameters": moved}]}
    compared = Comparison(one, {**one.result, "diagnosis": diagnosis})
    assert compared.largest_difference == pytest.approx(2.5)
    assert comparison_tables([compared])[0].rows[-1][2:5] == ["1/1", "1/1", "0/1"]
