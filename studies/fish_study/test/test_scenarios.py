# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios of the blind study: what is drawn, and how it is swum."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from prove_samples import small

from fish_report.errors import UserError
from fish_sim.effects import EFFECTS
from fish_sim.ops import NUMPY
from fish_sim.robot import Robot
from fish_sim.scheme import default_scheme
from fish_sim.sensors import SENSOR_EFFECTS
from fish_study import build, scenario_groups
from fish_study.build import make_readings
from fish_study.fish_sim_with_imu import FishSimWithImu
from fish_study.other_forms import OTHER_FORMS
from fish_study.out_of_vocabulary import OUTSIDE, PLANT_EFFECTS
from fish_study.runner import Job, run_scenario
from fish_study.scenario import Scenario, ScenarioError
from fish_study.study import read_json
from fish_study.swim import Readings
from fish_study.true_names import true_names
from fish_sysid.dataset.synthetic import FULL_SPEED
from fish_sysid.diagnosis.vocabulary import candidates
from fish_sysid.estimation.parametrization import SENSOR_FIELDS


def test_scenarios_are_drawn_from_the_seed_alone() -> None:
    names = list(scenario_groups.GROUPS)
    scenarios = scenario_groups.draw_scenarios(60, names, 7)
    assert (
        scenarios
        == scenario_groups.draw_scenarios(60, names, 7)
        != scenario_groups.draw_scenarios(60, names, 8)
    )
    assert len(scenarios) == 60
    assert {w.group for w in scenarios} == set(names)
    assert [w.group for w in scenarios] != sorted((w.group for w in scenarios), key=names.index)
    assert all(Scenario.of(w.label()) == w for w in scenarios)
    hidden = {
        scenario_groups.single(np.random.default_rng(0), k).names[0]
        for k in range(len(candidates()) + 1)
    }
    assert hidden == {*candidates(), *OTHER_FORMS}
    with pytest.raises(ValueError, match="known: single"):
        scenario_groups.draw_scenarios(3, ["nonsense"], 0)


def test_the_example_s_script_deletes_nothing_that_it_has_not_written(tmp_path: Path) -> None:
    script = Path(__file__).parents[3] / "examples" / "hidden_drag" / "make_recordings.py"
    folder_of = runpy.run_path(str(script))["folder_of"]
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(UserError, match="exists and is not empty"):
        folder_of([str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
    assert folder_of([str(tmp_path / "new")]) == tmp_path / "new"
    own = folder_of.__globals__["OWN"]
    assert own == script.parent / "recordings"
    folder_of.__globals__["OWN"] = tmp_path
    assert folder_of([]) == tmp_path
    assert not tmp_path.exists()


def test_no_outside_effect_is_in_the_vocabulary() -> None:
    assert not set(OUTSIDE) & {*candidates(), *EFFECTS}
    assert set(OUTSIDE) < set(PLANT_EFFECTS)


def test_another_form_of_a_name_counts_as_that_name() -> None:
    flow, p = (
        OTHER_FORMS["vortex"].water,
        SimpleNamespace(speed=0.04, at_x=0.3, at_y=-0.1, core=0.5),
    )
    velocity, ((a, b), (c, d)) = flow(p, 0.3, 0.4, None, NUMPY)  # a core above its middle
    assert velocity == pytest.approx((-0.04, 0.0), abs=1e-15)
    assert a + d == pytest.approx(0.0, abs=1e-15)
    h = 1e-6
    up, right = (flow(p, 0.2 + dx, 0.1 + dy, None, NUMPY)[0] for dx, dy in ((0.0, h), (h, 0.0)))
    down, left = (flow(p, 0.2 - dx, 0.1 - dy, None, NUMPY)[0] for dx, dy in ((0.0, h), (h, 0.0)))
    (a, b), (c, d) = flow(p, 0.2, 0.1, None, NUMPY)[1]
    slopes = [(u - v) / (2 * h) for u, v in zip((*right, *up), (*left, *down), strict=True)]
    assert slopes == pytest.approx([a, c, b, d], abs=1e-9)
    scenario = scenario_groups.single(np.random.default_rng(0), len(candidates()))
    assert scenario.names == ("vortex",)
    assert true_names(scenario) == ("nonuniform_current",)
    assert true_names(small("single")) is None


def test_the_hidden_effect_changes_the_motion_and_the_rest_stays() -> None:
    hidden = small("outside", 4)
    without = replace(hidden, effects={})
    a, b, again = (make_readings(w)[0] for w in (hidden, without, hidden))
    assert np.array_equal(a.truth, again.truth)
    assert np.abs(a.truth - b.truth).max() > 1e-3


@pytest.mark.parametrize("name", [*candidates(), *OUTSIDE, *OTHER_FORMS])
def test_an_effect_is_drawn_as_strong_as_asked_and_elsewhere_in_every_scenario(name: str) -> None:
    """Strengths are distances from neutral in typical ones; a limit acts by being small: half as strong is twice as high."""
    effect = {**EFFECTS, **SENSOR_EFFECTS, **OUTSIDE, **OTHER_FORMS}[name]
    drawn = [
        scenario_groups.draw_effect(name, 0.5, np.random.default_rng(seed)) for seed in range(40)
    ]
    signs = set()
    for key, p in effect.parameters.items():
        values = np.array([d[key] for d in drawn])
        assert (p.lowest <= values).all()
        assert (values <= p.highest).all()
        if key in scenario_groups.ELSEWHERE.get(name, {}):
            low, high = scenario_groups.ELSEWHERE[name][key]
            near = 0.2 * (high - low)
            assert low <= values.min() < low + near
            assert high - near < values.max() <= high
        elif key not in effect.strength:
            assert (values == p.value).all()
        elif name in ("rudder_saturation", "rotor_saturation"):
            assert np.all((values >= p.typical / 0.5 / 1.15) & (values <= p.typical / 0.5 / 0.85))
        elif p.typical != p.value:
            share = (values - p.value) / (p.typical - p.value)
            assert np.all(
                (np.abs(share) >= 0.5 * 0.85 - 1e-12) & (np.abs(share) <= 0.5 * 1.15 + 1e-12)
            )
            signs |= set(np.sign(share))
    assert signs <= ({1.0, -1.0} if name in scenario_groups.SIGNED else {1.0})
    assert name not in scenario_groups.SIGNED or signs == {1.0, -1.0}


def test_scenarios_of_a_group_are_what_the_group_says() -> None:
    def drawn(group: str, count: int = 40) -> list[Scenario]:
        return [scenario_groups.GROUPS[group](np.random.default_rng(k), k) for k in range(count)]

    assert {w.trials for w in drawn("feedback")} == {"closed"}
    assert {w.trials for w in drawn("absorbed")} == {"one_speed"}
    assert {w.noise for w in drawn("noise")} == {0.5, 1.0, 2.0, 4.0}
    ladder = drawn("ladder")
    assert {w.strength for w in ladder} == {0.125, 0.25, 0.5, 1.0, 2.0}
    weak = {name for w in ladder if w.strength < 1.0 for name in w.names}
    assert weak.isdisjoint(
        {"rudder_saturation", "rotor_saturation"}
    )  # no command reaches a weak limit
    assert all(len(w.names) == 2 for w in drawn("two"))
    assert not any(w.names for w in drawn("null"))
    assert {w.names[0] for w in drawn("sensor")} == set(SENSOR_FIELDS)
    assert {w.names[0] for w in drawn("outside")} == set(OUTSIDE)
    assert {(w.links, w.method) for w in drawn("null")} >= {(3, "dop853"), (5, "rk4")}
    named = {n: w for w in drawn("single") for n in w.names}
    for name in (
        "rotor_lag",
        "rotor_saturation",
        "battery_sag",
    ):  # an encoder would give the answer away
        assert not named[name].encoder
    encoders = [w.encoder for w in drawn("null")]
    assert 0 < encoders.count(False) < 15
    factors = np.array([f for w in drawn("null") for f in w.parameters.values()])
    assert factors.min() >= 0.75
    assert factors.max() <= 1.25
    assert abs(factors.mean() - 1.0) < 0.02
    assert not {"head_mass", "link_length", "servo_rate_limit"} & set(
        drawn("null", 1)[0].parameters
    )


def of_trials(kind: str) -> list[Readings]:
    return make_readings(replace(small("null"), trials=kind))


def test_trials_are_open_loop_under_feedback_or_at_one_speed() -> None:
    assert [r.commands.shape[1] for r in of_trials("mixed")] == [2, 1]
    (closed,) = of_trials("closed")
    assert closed.commands.shape == (400, 3, 2)
    assert closed.truth.shape == (400, 3, 3)
    (one,) = of_trials("one_speed")
    rotor, second = one.commands[..., 0], slice(100, None)
    assert np.array_equal(rotor[:, 0], rotor[:, 1])
    assert np.array_equal(rotor[:, 0], rotor[:, 2])
    assert np.abs(rotor[second]).max() == pytest.approx(np.sqrt(0.15) * FULL_SPEED, rel=0.01)
    assert not np.array_equal(one.commands[:, 0, 1], one.commands[:, 1, 1])
    np.testing.assert_allclose(  # the phase that is recorded is that of the speed
        rotor[second, 0], np.sqrt(0.15) * FULL_SPEED * np.sin(one.phase[second, 0]), atol=1e-9
    )


def test_the_water_pushes_a_fish_as_long_and_as_hard_as_it_says() -> None:
    """An Ornstein-Uhlenbeck process that is stationary from the start: 3 and 6 mN, 0.15 mN m, for 0.2 s."""
    plant = FishSimWithImu(Robot(), default_scheme(3), 300, 2.0, np.random.default_rng(0))
    first = plant._push
    for _ in range(20):
        plant.step(np.zeros((300, 2)))
    for push in (first, plant._push):
        np.testing.assert_allclose(push.std(axis=0), [0.006, 0.012, 3e-4], rtol=0.15)
    kept = (first * plant._push).mean(axis=0) / (first.std(axis=0) * plant._push.std(axis=0))
    np.testing.assert_allclose(kept, np.exp(-1.0), atol=0.15)


def test_a_program_whose_way_fits_nowhere_is_swum_more_slowly(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def find_start(way: np.ndarray, *_: object) -> tuple[float, float, float] | None:
        asked.append(way)
        return (0.0, 0.0, 0.0) if len(asked) > 4 else None

    monkeypatch.setattr(build, "find_start", find_start)
    monkeypatch.setattr(
        build,
        "open_loop",
        lambda kinds, duration, random, calm: np.ones((400, len(kinds), 2)) * calm[:, None],
    )
    first, _ = make_readings(small("null"))
    assert first.commands[0, :, 0] == pytest.approx(
        [build.SLOWER**2] * 2
    )  # both fit at the third try


def test_a_program_at_one_speed_is_swum_more_slowly_too(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def find_start(way: np.ndarray, *_: object) -> tuple[float, float, float] | None:
        asked.append(way)
        return (
            None if len(asked) in (2, 4) else (0.0, 0.0, 0.0)
        )  # the second of three trials, twice

    monkeypatch.setattr(build, "find_start", find_start)
    (one,) = of_trials("one_speed")
    rotor = one.commands[..., 0]
    np.testing.assert_allclose(rotor[:, 1], build.SLOWER**2 * rotor[:, 0])
    assert np.array_equal(rotor[:, 2], rotor[:, 0])
    assert len(asked) == 5


def test_a_fish_that_fits_nowhere_into_the_pool_is_no_scenario(tmp_path: Path, monkeypatch) -> None:
    """It began at the centre and swam through the walls."""
    monkeypatch.setattr(build, "find_start", lambda *_: None)
    with pytest.raises(
        ScenarioError, match="2 of 2 trials of 4 s fit nowhere into the pool, 12 programs tried"
    ):
        make_readings(small("null"))
    run_scenario(Job("a", small("null"), tmp_path, ("false",)))
    assert read_json(tmp_path / "result.json")["error"].startswith("no scenario: 2 of 2 trials")
