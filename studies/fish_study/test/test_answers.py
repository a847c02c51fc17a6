# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an answer is worth once the label is open, by hand, against the oracle, and in the newest study's file.

Competitors are AIC, BIC, the held-out error and fits of the residual force. Where and when localised effects act is held against
their own equations. The newest study's file is complete, as it was committed to, made again from its seeds, and the page shows
its numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from math import log
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from prove_samples import answered, diagnosis, failed, small

from fish_study.ablation import says_changed
from fish_study.answer_tables import asked_table, failure_table, group_table, name_table
from fish_study.build import make_readings
from fish_study.calibration import Power, calibration, calibration_table, null_table, power
from fish_study.competitors import (
    CompetitorScores,
    aic_cost,
    bic_cost,
    choice,
    criterion_table,
    smallest_error,
)
from fish_study.oracle import (
    OracleResult,
    as_experiment,
    detects,
    fit_oracle,
    with_truth,
)
from fish_study.oracle_scores import (
    dof_overlap,
    oracle_scores,
    overlap,
    stated_range,
    stated_times,
    true_wrench,
)
from fish_study.oracle_tables import OracleScores, competitor_table, oracle_table
from fish_study.prove_page import (
    _confusion,
    _power,
    seeds_sentence,
    tables,
    write_prove_page,
)
from fish_study.recorded_comparison import (
    Comparison,
    Recorded,
    comparison_tables,
    lost,
    recorded_answers,
    stage_table,
)
from fish_study.results_page import generated_part, results_text, write_generated_part
from fish_study.scenario import Scenario, ScenarioError
from fish_study.scenario_groups import GROUPS, PAIRS_OF_DAYS, draw_scenarios
from fish_study.score import ParameterError, Score, score_scenario
from fish_study.share import Share
from fish_study.study import Study, opened_studies
from fish_sysid.diagnosis.effect_wrench import (
    acting,
    effect_wrench,
    f1,
    regimes,
)
from fish_sysid.diagnosis.latent_force import MissingForce
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate

CURRENT = Scenario("single", 1, {"current": {"x": 0.03, "y": 0.0}})
ROOT = Path(__file__).parents[3]
ARCHIVE = ROOT / "studies" / "data" / "blind_study_26.tar.xz"
RECORDED = set(GROUPS) - set(PAIRS_OF_DAYS)


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
    assert generated_part(page) == results_text(ARCHIVE), "run python studies/newest_study.py page"


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


def again(hidden: tuple[str, ...], before: str, now: str, error: float = 1.0) -> Comparison:
    """A scenario whose recorded and new answers are one name or a verdict; the new model's error is `error` times as large."""

    def result(answer: str, position: float) -> dict[str, Any]:
        names = () if answer in ("no_mismatch", "unexplained") else ((answer, "physics", 0.99),)
        made = diagnosis(*names, verdict="missing_physics" if names else answer)
        rms = {"rms": {"2 s": {"position_m": position}}}
        written = {"written": "with_effects", "with_effects": rms, "model_yaml": None}
        made["diagnosis"]["fit"] = written if names else {"written": "", "model_yaml": rms}
        return {**made, "tool": "v"}

    scenario = Scenario("single", 1, {name: {"x": 0.03} for name in hidden})
    recorded = Recorded("01_scenario_0000", scenario, result(before, 0.01))
    return Comparison(recorded, result(now, 0.01 * error))


def test_a_stage_is_worth_the_right_answers_that_are_lost_without_it() -> None:
    one, nothing, unnamed = ("current",), (), ("jet",)
    compared = [
        again(one, "current", "tether"),  # lost
        again(one, "current", "unexplained", 3.0),  # lost
        again(one, "tether", "current"),  # won
        again(nothing, "no_mismatch", "tether"),  # lost
        again(unnamed, "unexplained", "no_mismatch"),  # lost
        again(unnamed, "tether", "unexplained"),  # won
        again(one, "current", "current", 0.5),
    ]
    assert [c.right for c in compared[:3]] == [(True, False), (True, False), (False, True)]
    assert lost(compared) == 2
    (row,) = stage_table("anneal", 9, compared).rows
    assert row == ["anneal", "9", "7", "5", "3", "6", "1.00, 3.00", "60, 60"]


def test_a_search_is_changed_by_the_stages_that_its_answer_has() -> None:
    result = diagnosis(verdict="no_mismatch")
    assert not says_changed(result, "anneal")  # of a tool that does not say
    result["diagnosis"]["stages"] = ["anneal"]
    assert says_changed(result, "anneal")
    assert not says_changed(result, "model order")
    assert not says_changed({"diagnosis": None}, "anneal")


def found(gain: float) -> OracleResult:
    nominal, true = ([[share * e] * 3 for e in (0.01, 0.02, 0.05)] for share in (2.0, 1.0))
    return OracleResult(gain, 1, nominal, true)


def test_the_oracle_detects_what_gains_more_than_nothing_would() -> None:
    assert detects(found(3.0), [])
    assert not detects(found(2.6), [])
    assert not detects(found(3.0), [found(100.0)] * 25)  # but not where nothing looks like that too


def test_answers_against_the_oracle_by_hand() -> None:
    answer = diagnosis(("current", "physics", 0.9))
    answer["diagnosis"]["fit"]["with_effects"]["rms"] = {"2 s": {"position_m": 0.022}}
    right = score_scenario(Scenario("single", 1, {"current": {"x": 0.03}}), answer)
    null = score_scenario(Scenario("null", 2), diagnosis(verdict="no_mismatch"))
    nameless = [
        score_scenario(Scenario("outside", seed, {"jet": {"x": 0.03}}), diagnosis(verdict=verdict))
        for seed, verdict in ((3, "unexplained"), (4, "no_mismatch"), (5, "no_mismatch"))
    ]
    sparse = {"sindy": "tether", "sindy_r2": 0.4, "neural_r2": 0.3}
    silent = {"sindy": None, "sindy_r2": 0.0, "neural_r2": 0.0}
    content = {
        1: {"overlap": 0.5, "f1": 0.6, "range_f1": None, "dof": 0.7, "competitors": sparse},
        2: {"overlap": None, "f1": None, "dof": None, "competitors": silent},
    }
    gains = {1: 9.0, 2: 0.0, 3: 9.0, 4: 9.0, 5: 0.0}
    fits = {seed: {"fits": asdict(found(gain))} for seed, gain in gains.items()}
    scores = {seed: {**content.get(seed, {}), **fits[seed]} for seed in gains}
    answers = [right, null, *nameless]
    oracle = OracleScores.of(answers, scores)
    assert oracle.detected == {1: True, 3: True, 4: True, 5: False}
    assert [row[2] for row in oracle_table(answers, oracle).rows] == [
        "100% of 1",
        str(Share(1, 2)),
        "1.10 (1 scenarios)",
        "0.55 (1 scenarios)",
        "0.70 (1 scenarios)",
        "0.50 (1 scenarios)",
        "0.60 (1 scenarios)",
        "–",
    ]
    rows = competitor_table([right, null], oracle).rows
    assert rows[0][1].startswith("1/1")
    assert rows[1][1].startswith("0/1")
    assert rows[1][2].startswith("0/1")


def named_current(*_: object) -> CompetitorScores:
    """Stands in for competitors, which need packages that the tests do without."""
    return CompetitorScores("current", 0.5, 0.6)


def test_the_oracle_finds_a_hidden_current() -> None:
    """Its fit from the true values predicts better, with the noise of the scenario."""
    scenario = small("single", 1, encoder=True, noise=2.0)
    assert scenario.names == ("current",)
    experiment = as_experiment(make_readings(scenario), scenario.encoder)
    fits = fit_oracle(scenario, experiment, ["trial_02"], ["current"])
    assert fits.training.names == ("trial_00", "trial_01")
    assert fits.held_out.names == ("trial_02",)
    assert fits.true.noise.gyro == pytest.approx(2.0 * Noise().gyro, rel=0.1)
    for key, true in scenario.effects["current"].items():
        name = f"current.{key}"
        assert fits.true.values[name] == pytest.approx(
            true, abs=4.0 * fits.true.standard_errors[name]
        )
    result = fits.result
    assert detects(result, [])
    assert result.gain > 100.0
    assert result.parameters == 2
    assert result.rms_true[1][0] < 0.7 * result.rms_nominal[1][0]
    answer = {"fit": {"held_out_trials": ["trial_02"]}, "effects": []}
    content = oracle_scores(scenario, answer, named_current)
    assert OracleResult.read(content["fits"]).gain == pytest.approx(result.gain)
    # without an answer nothing overlaps, and a current acts everywhere
    assert {content[k] for k in ("dof", "overlap", "f1", "range_f1")} == {None}
    assert content["competitors"] == {"sindy": "current", "sindy_r2": 0.5, "neural_r2": 0.6}


def test_a_scenario_without_an_answer_has_an_oracle_and_counts_as_not_right() -> None:
    """Neither the tool nor a table of it may lose the scenario."""
    kinds = (("single", 1), ("null", 1), ("null", 0))
    scenarios = [
        small(group, number, encoder=True, seed=k) for k, (group, number) in enumerate(kinds)
    ]
    assert [scenario.links > 3 for scenario in scenarios] == [False, True, False]
    none = {"seconds": 1.0, "diagnosis": None, "error": "exit status 3"}
    answers = [score_scenario(scenario, none) for scenario in scenarios]
    scores = {s.seed: oracle_scores(s, None, named_current) for s in scenarios}
    assert (
        scores[1]["fits"] is None
    )  # of a fish with more links no structure that is fitted is true
    oracle = OracleScores.of(answers, scores)
    assert oracle.detected == {0: True}
    assert oracle_table(answers, oracle).rows[0][2] == "0% of 1"
    rows = competitor_table(answers, oracle).rows
    assert [row[1].split(" =")[0] for row in rows[:2]] == ["0/1", "1/1"]
    assert rows[0][2] == "–"
    assert rows[1][2].startswith("1/1")


def test_a_scenario_that_cannot_be_made_has_no_oracle(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(_: Scenario) -> None:
        raise ScenarioError("a fish that fits nowhere")

    monkeypatch.setattr("fish_study.oracle_scores.make_readings", lost)
    assert oracle_scores(small("single", 1), None)["fits"] is None


def test_the_oracle_finds_what_has_no_name() -> None:
    scenario = small("outside", 4, encoder=True)
    assert scenario.names == ("compass",)
    answer = {"fit": {"held_out_trials": ["trial_02"]}, "effects": []}
    result = OracleResult.read(oracle_scores(scenario, answer, named_current)["fits"])
    assert detects(result, [])
    assert result.parameters == 2
    assert np.isfinite(result.rms_true[1][0])


def test_a_competitor_finds_the_law_it_was_shown() -> None:
    pytest.importorskip("pysindy")
    from fish_study.competitors import _sparse

    random = np.random.default_rng(0)
    names = (
        "surge_speed",
        "sway_speed",
        "yaw_rate",
        "rudder",
        "rotor_speed",
        "wall_distance",
        "heading",
        "time",
        "x",
        "y",
    )

    def force(size: float) -> MissingForce:
        c = {name: random.standard_normal((6000, 2)) for name in names}
        wrench = 1e-3 * random.standard_normal((6000, 2, 3))
        wrench[..., 2] += size * np.cos(c["heading"])
        return MissingForce(("a", "b"), wrench, np.ones_like(wrench), c)

    name, share = _sparse(force(0.01), force(0.01))
    assert name == "current"
    assert share < 1.0
    assert _sparse(force(0.0), force(0.0))[0] is None


def test_overlap_of_times_and_degrees_of_freedom() -> None:
    acts, names = np.zeros((800, 2), dtype=bool), ["trial_00", "trial_01"]
    acts[200:400, 1] = True
    hit = [
        {"trial": "trial_01", "from": 2.0, "to": 4.0},
        {"trial": "elsewhere", "from": 0.0, "to": 8.0},
    ]
    assert overlap(stated_times(hit, names, 800), acts) == 1.0
    assert overlap(stated_times([{**hit[0], "to": 6.0}], names, 800), acts) == 0.5
    assert overlap(stated_times([{**hit[0], "trial": "trial_00"}], names, 800), acts) == 0.0
    assert f1(stated_times([{**hit[0], "to": 6.0}], names, 800), acts) == pytest.approx(2.0 / 3.0)
    assert dof_overlap({"surge": 0.7, "yaw": 0.3}, {"surge": 0.5, "sway": 0.5}) == 0.5


def test_a_localised_effect_is_seen_where_it_acts() -> None:
    """A fish that swims to a wall, with drag there: the interval before the wall, and the distance as what tells it."""
    effects = {"wall_effect": {"k": 2.5, "length": 0.2}}
    scenario = Scenario("single", 3, effects, count=3, duration=10.0)
    experiment = as_experiment(make_readings(scenario), True)
    push = true_wrench(scenario, experiment)
    assert push is not None
    acts = acting(push, np.array(Noise().wrench))
    near = push.covariates["wall_distance"]
    assert 0.02 < acts.mean() < 0.8
    assert near[acts].mean() < near[~acts].mean()
    assert stated_range(regimes(push, np.array(Noise().wrench)), push.covariates)[acts].mean() > 0.5
    assert true_wrench(Scenario("single", 1, {"current": {"x": 0.03}}), experiment) is None


def test_the_effect_wrench_of_a_drag_is_its_equation() -> None:
    """-k |u| u on the head, from the accelerations with and without it."""
    scenario = Scenario(
        "single",
        1,
        {"quadratic_drag": {"surge": 0.5, "sway": 0.0, "yaw": 0.0}},
        count=2,
        duration=4.0,
    )
    experiment = as_experiment(make_readings(scenario), True)
    hypothesis, theta = with_truth(scenario, scenario.names)
    push = effect_wrench(
        evaluate(hypothesis, theta, experiment, Noise()), "quadratic_drag", experiment
    )
    u = push.covariates["surge_speed"]
    np.testing.assert_allclose(push.wrench[..., 0], -0.5 * np.abs(u) * u, atol=1e-6)
    np.testing.assert_allclose(push.wrench[..., 1:], 0.0, atol=1e-6)


def test_the_effect_wrench_of_a_flow_is_that_of_all_of_it() -> None:
    """The mean of a flow that differs hardly from place to place pushes as the uniform current does."""
    push = {}
    for name, values in (
        ("current", {"x": 0.05}),
        ("nonuniform_current", {"mean_x": 0.05, "shear_x": 1e-4}),
    ):
        scenario = Scenario("single", 1, {name: values}, count=2, duration=2.0)
        experiment = as_experiment(make_readings(scenario), True)
        hypothesis, theta = with_truth(scenario, scenario.names)
        push[name] = effect_wrench(
            evaluate(hypothesis, theta, experiment, Noise()), name, experiment
        ).wrench
    size = np.abs(push["current"]).max()
    np.testing.assert_allclose(push["nonuniform_current"], push["current"], atol=0.05 * size)
