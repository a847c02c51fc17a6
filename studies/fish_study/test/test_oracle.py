# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The oracle and the competitors: what they find, and how it is counted."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from prove_samples import diagnosis, small

from fish_study.build import make_readings
from fish_study.competitors import CompetitorScores
from fish_study.oracle import OracleResult, as_experiment, detects, fit_oracle
from fish_study.oracle_scores import oracle_scores
from fish_study.oracle_tables import OracleScores, competitor_table, oracle_table
from fish_study.scenario import Scenario, ScenarioError
from fish_study.score import score_scenario
from fish_study.share import Share
from fish_sysid.diagnosis.latent_force import MissingForce
from fish_sysid.estimation.ekf_types import Noise


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
