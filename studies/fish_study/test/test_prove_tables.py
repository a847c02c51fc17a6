# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How answers are counted, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from prove_samples import answered, diagnosis, failed

from fish_study.asked_table import asked_table
from fish_study.calibration import calibration, calibration_table
from fish_study.group_tables import failure_table, group_table, name_table
from fish_study.nulls import null_table
from fish_study.power import Power, power
from fish_study.prove_page import (
    _confusion,
    _power,
    seeds_sentence,
    tables,
    write_prove_page,
)
from fish_study.scenario import Scenario
from fish_study.score import Score, score_scenario
from fish_study.share import Share

CURRENT = Scenario("single", 1, {"current": {"x": 0.03, "y": 0.0}})


def test_the_page_says_of_every_seed_whether_it_was_drawn() -> None:
    drawn, given = (
        {"seed": 8, "command": "prove", "drawn": True},
        {"seed": 5, "command": "prove --seed 5", "drawn": False},
    )
    old = [
        {key: about[key] for key in ("seed", "command")} for about in (drawn, given)
    ]  # a study.json without the entry
    for a, b in ((drawn, given), old):
        assert seeds_sentence([a, a]).startswith("The seeds were drawn at run time; salted hashes")
        assert seeds_sentence([b]).startswith("Seed 5 was given")
        assert "drawn" not in seeds_sentence([b])
        assert seeds_sentence([b, b]).startswith("Seeds 5, 5 were given")
        assert seeds_sentence([a, b]).endswith("first run. The other seeds were drawn at run time.")


def test_what_was_asked_is_counted_over_its_own_scenarios() -> None:
    """No row counts a scenario of another group, and a scenario without an answer flatters none."""
    scores = [
        answered("single", ("current",), "current"),
        answered("single", ("tether",), "wall_effect", rivals=("tether",)),
        answered("sensor", ("camera_scale",), "payload"),
        failed("sensor", "gyro_scale"),
        answered("feedback", ("rudder_lag",), "rudder_lag", kind="actuator"),
        answered("null", ()),
        answered("null", (), verdict="no_mismatch"),
        failed("null"),
        answered("two", ("current", "tip_slip"), "current", "tip_slip"),
        answered("two", ("current", "tip_slip"), "current", "tip_slip", "payload"),
        answered("two", ("current", "tip_slip"), "current", rivals=("tip_slip",)),
        failed("two", "current", "tip_slip"),
        answered("outside", ("jet",), verdict="unexplained"),
        answered("outside", ("jet",), "payload"),
        answered("outside", ("jet",), "payload", probability=0.5),
        failed("outside", "jet"),
        answered("ladder", ("current",), "tether", "payload"),
        answered("noise", ("current",), "current", "payload", "tether"),
    ]
    table = asked_table(scores)
    assert {what: measured.split(" =")[0] for what, _, measured in table.rows} == {
        "right name first, single effects": "1/4",
        "truth in the answered set, single effects": "2/4",
        "right name first, closed loop only": "1/1",
        "false alarms, nothing hidden": "1/2",
        "both of two effects": "2/4",
        "no false third name": "2/4",
        "no name exists: called unexplained": "1/4",
        "no name exists: wrong name with confidence": "1/3",
        "sensor impostors called physics": "1/1",
        "mean size of the answered set, single effects": "1.33",
        "parameters within 3 standard errors or 20 %, right names": "1/1",
        "seconds per data set, median (longest)": "60 (240)",
    }
    groups = {row[0]: row[1:] for row in group_table(scores).rows}
    assert groups["two"] == ["4", "3/4", "3/4", "2.33", "1/4", "1/4", "3/4", "0/4", "1", "60"]
    assert groups["outside"] == ["4", "–", "–", "1.00", "–", "2/4", "3/4", "1/4", "1", "60"]
    assert [row[0] for row in failure_table(scores).rows] == ["sensor", "null", "two", "outside"]
    assert ["jet", "4", "payload (2); unexplained (1); failed (1)"] in name_table(scores).rows


def test_without_a_scenario_of_its_kind_nothing_is_measured() -> None:
    table = asked_table([answered("null", (), verdict="no_mismatch")])
    assert [row[2] for row in table.rows[:3]] == ["–"] * 3
    assert table.rows[-1][2] == "60 (60)"


def test_gains_of_null_scenarios_by_hand() -> None:
    scenarios = [Scenario("null", k, links=links) for k, links in enumerate((3, 3, 5))]
    scores = [score_scenario(w, diagnosis(verdict="no_mismatch")) for w in scenarios]
    scores[0] = replace(scores[0], ranking={"current": 2.0, "tether": -np.inf})
    table = null_table(
        [*scores, score_scenario(Scenario("single", 9, {"current": {}}), diagnosis())]
    )
    assert table.rows == [["3", "1", "2", "6.0", "10.0"], ["5", "1", "1", "10.0", "10.0"]]
    assert (
        "0.6 in the median" in table.note
    )  # the larger of two chi square / 2 with one degree of freedom
    assert null_table([]) is None


def test_share_has_the_exact_interval() -> None:
    low, high = Share(0, 100).interval
    assert low == 0.0
    assert high == pytest.approx(1.0 - 0.025 ** (1 / 100))
    assert Share(100, 100).interval == pytest.approx((0.025 ** (1 / 100), 1.0))
    assert str(Share(0, 0)) == "–"


def test_stated_probabilities_are_held_against_how_often_the_name_was_right() -> None:
    def said(probability: float, name: str = "current") -> Score:
        return answered("single", ("current",), name, probability=probability)

    scores = [
        said(0.5),
        said(0.5, "tether"),
        said(0.8),
        said(0.95, "tether"),
        said(1.0),
        failed("single", "current"),
    ]
    bins = calibration(scores)
    assert [(b.low, b.right.k, b.right.n, b.stated) for b in bins] == [
        (0.5, 1, 2, 0.5),
        (0.8, 1, 1, 0.8),
        (0.95, 1, 2, 0.975),
    ]
    squares = (0.25 + 0.25 + 0.04 + 0.9025 + 0.0) / 5
    assert f"Brier score {squares:.3f}" in calibration_table(scores).note


def test_power_counts_names_and_rivals_per_strength() -> None:
    scores = []
    for i, (strength, name) in enumerate([(0.5, "tether"), (0.5, "current"), (1.0, "current")]):
        scenario = Scenario("ladder", i, {"current": {"x": 0.03}}, strength)
        scores.append(score_scenario(scenario, diagnosis((name, "physics", 0.9))))
    beside = score_scenario(
        Scenario("ladder", 3, {"current": {}}, 0.5),
        diagnosis(("tether", "physics", 0.9), rivals=("current",)),
    )
    elsewhere = score_scenario(Scenario("single", 4, {"current": {}}), diagnosis())
    steps = power([*scores, beside, elsewhere], {0: True, 1: True, 2: False})
    assert [(p.strength, p.found.k, p.found.n, p.oracle.k, p.oracle.n) for p in steps] == [
        (0.5, 2, 3, 2, 2),
        (1.0, 1, 1, 0, 1),
    ]


def test_bars_of_the_power_curve_reach_to_both_ends_of_the_interval() -> None:
    found = Share(9, 10)
    (line,) = _power([Power(1.0, found, None)]).data
    low, high = found.interval
    assert line.y == (0.9,)
    assert line.error_y.array == pytest.approx([high - 0.9])
    assert line.error_y.arrayminus == pytest.approx([0.9 - low])


def test_the_page_counts_each_hidden_thing_against_the_first_answer(tmp_path) -> None:
    scores = [
        answered("single", ("current",), "tether", "current"),
        answered("feedback", ("current",), "tether"),
        answered("null", (), verdict="no_mismatch"),
        answered("two", ("current", "tether"), "tether"),
        failed("single", "tether"),
    ]
    write_prove_page(
        tmp_path / "report.html", [{"seed": 7, "began": "today", "command": "prove"}], scores
    )
    page = (tmp_path / "report.html").read_text()
    assert "5 scenarios, 4 of them with something hidden; seed 7, today" in page
    shown = [table.title for table in tables(scores)]
    assert "No answer" in shown
    assert "Detection power over strength" not in shown
    heat = _confusion(scores).data[0]
    counted = {
        (h, a): n
        for h, row in zip(heat.y, heat.z, strict=True)
        for a, n in zip(heat.x, row, strict=True)
        if n
    }
    assert counted == {
        ("current", "tether"): 2,
        ("nothing (fish_sim)", "no_mismatch"): 1,
        ("tether", "failed"): 1,
    }
