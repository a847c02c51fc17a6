"""What answers are worth and how they are counted, by hand."""

from __future__ import annotations

from dataclasses import replace
from math import log

import numpy as np
import pytest
from prove_samples import diagnosis

from fish_study.nulls import null_table
from fish_study.prove_page import (
    _confusion,
    _power,
    seeds_sentence,
    tables,
    write_prove_page,
)
from fish_study.scenario import World
from fish_study.score import ParameterError, Score, score_world
from fish_study.tables import (
    Power,
    Share,
    aic_cost,
    asked_table,
    bic_cost,
    calibration,
    calibration_table,
    choice,
    criterion_table,
    failure_table,
    group_table,
    name_table,
    power,
    smallest_error,
)

CURRENT = World("single", 1, {"current": {"x": 0.03, "y": 0.0}})


def answered(
    group: str,
    hidden: tuple[str, ...],
    *named: str,
    kind: str = "physics",
    probability: float = 0.95,
    verdict: str = "missing_physics",
    rivals: tuple[str, ...] = (),
) -> Score:
    """A world of a group in which this is hidden, and the names that the tool gave."""
    world = World(group, 0, {name: {"x": 0.03} for name in hidden})
    effects = [(name, kind, probability) for name in named]
    return score_world(world, diagnosis(*effects, verdict=verdict, rivals=rivals))


def failed(group: str, *hidden: str) -> Score:
    """A world on which the tool gave no answer."""
    result = {"seconds": 240.0, "diagnosis": None, "error": "exit status 3: cannot"}
    return score_world(World(group, 0, {name: {} for name in hidden}), result)


def test_an_answer_is_right_exact_in_the_set_or_confidently_wrong() -> None:
    right = score_world(CURRENT, diagnosis(("current", "physics", 0.97), rivals=("tether",)))
    assert right.top1
    assert right.in_set
    assert right.exact
    assert not right.confident_wrong
    assert right.answered == {"current", "tether"}
    assert [p.within for p in right.parameters] == [True]  # ten standard errors, but 3 %
    wrong = score_world(CURRENT, diagnosis(("tether", "physics", 0.97), rivals=("current",)))
    assert not wrong.top1
    assert wrong.in_set
    assert wrong.confident_wrong
    assert wrong.false_names == ("tether",)
    nothing = score_world(World("null", 2), diagnosis(verdict="no_mismatch"))
    assert not nothing.alarm
    assert nothing.exact
    assert not nothing.in_set
    assert not nothing.unnamed
    odd = score_world(World("outside", 3, {"jet": {"x": 0.1}}), diagnosis(verdict="unexplained"))
    assert odd.unnamed
    assert odd.alarm
    assert not odd.truth
    pair = World("two", 4, {"current": {}, "rudder_offset": {}})
    half = score_world(pair, diagnosis(("current", "physics", 0.6)))
    assert half.top1
    assert not half.in_set
    assert not half.exact
    lens = score_world(
        World("sensor", 5, {"camera_scale": {}}), diagnosis(("payload", "physics", 0.99))
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


def test_rivals_of_the_tool_choose_by_penalised_gain_or_held_out_error() -> None:
    right = score_world(CURRENT, diagnosis(("current", "physics", 0.97)))
    assert choice(right, lambda name, _: 3.0 if name == "quadratic_drag" else 1.0) == "current"
    assert choice(right, lambda *_: 20.0) is None
    assert smallest_error(right) == "wall_effect"
    assert smallest_error(replace(right, held_out={"current": 0.011})) is None
    lost = diagnosis(("current", "physics", 0.97))  # what is not finite is null in the file
    lost["diagnosis"]["ranking"][1]["gain"] = None
    lost["diagnosis"]["refitted"][1]["held_out_rms"]["2 s"]["position_m"] = None
    assert choice(score_world(CURRENT, lost), lambda *_: 1.0) == "current"
    lost["diagnosis"]["fit"]["refitted"]["rms"]["2 s"]["position_m"] = None
    assert smallest_error(score_world(CURRENT, lost)) == "current"


def test_a_world_without_an_answer_is_right_for_no_method() -> None:
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


def test_the_page_says_of_every_seed_whether_it_was_drawn() -> None:
    drawn, given = (
        {"seed": 8, "command": "prove", "drawn": True},
        {"seed": 5, "command": "prove --seed 5", "drawn": False},
    )
    old = [
        {key: about[key] for key in ("seed", "command")} for about in (drawn, given)
    ]  # of before studies told it
    for a, b in ((drawn, given), old):
        assert seeds_sentence([a, a]).startswith("The seeds were drawn at run time; salted hashes")
        assert seeds_sentence([b]).startswith("Seed 5 was given")
        assert "drawn" not in seeds_sentence([b])
        assert seeds_sentence([b, b]).startswith("Seeds 5, 5 were given")
        assert seeds_sentence([a, b]).endswith("first run. The other seeds were drawn at run time.")


def test_information_criteria_cost_as_in_their_definitions() -> None:
    """Half of 2 k and half of k ln n: a current has two numbers; n counts what the ranking sees of training trials."""
    for count, duration, seen in ((3, 6.0, 2 * 6), (9, 12.0, 4 * 8)):
        for encoder, imu_and_encoder in ((True, 4), (False, 3)):
            world = replace(CURRENT, count=count, duration=duration, encoder=encoder)
            score = score_world(world, diagnosis())
            measured = seen * (100 * imu_and_encoder + 30 * 3)
            assert bic_cost("current", score) == pytest.approx(0.5 * 2 * log(measured))
            assert aic_cost("current", score) == 2.0


def test_a_name_costs_the_numbers_that_it_took_in_its_answer() -> None:
    """`nonuniform_current` has had 11, 17 and 37."""
    result = diagnosis()
    result["diagnosis"]["ranking"][0]["free_parameters"] = 17
    score = score_world(CURRENT, result)
    assert aic_cost("current", score) == 17.0
    assert (
        aic_cost("quadratic_drag", score)
        == aic_cost("quadratic_drag", replace(score, free={}))
        > 0.0
    )


def test_what_was_asked_is_counted_over_its_own_worlds() -> None:
    """No row counts a world of another group, and a world without an answer flatters none."""
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


def test_without_a_world_of_its_kind_nothing_is_measured() -> None:
    table = asked_table([answered("null", (), verdict="no_mismatch")])
    assert [row[2] for row in table.rows[:3]] == ["–"] * 3
    assert table.rows[-1][2] == "60 (60)"


def test_gains_of_null_worlds_by_hand() -> None:
    worlds = [World("null", k, links=links) for k, links in enumerate((3, 3, 5))]
    scores = [score_world(w, diagnosis(verdict="no_mismatch")) for w in worlds]
    scores[0] = replace(scores[0], ranking={"current": 2.0, "tether": -np.inf})
    table = null_table([*scores, score_world(World("single", 9, {"current": {}}), diagnosis())])
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
        world = World("ladder", i, {"current": {"x": 0.03}}, strength)
        scores.append(score_world(world, diagnosis((name, "physics", 0.9))))
    beside = score_world(
        World("ladder", 3, {"current": {}}, 0.5),
        diagnosis(("tether", "physics", 0.9), rivals=("current",)),
    )
    elsewhere = score_world(World("single", 4, {"current": {}}), diagnosis())
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


def test_competitors_are_judged_on_worlds_with_one_name_and_on_nulls() -> None:
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
    assert "5 worlds, 4 of them with something hidden; seed 7, today" in page
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
