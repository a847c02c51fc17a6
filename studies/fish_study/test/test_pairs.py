# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pairs of days: what is put into recordings, what the tool is given, and how its answers are counted."""

from __future__ import annotations

import sys
from dataclasses import replace
from math import comb
from pathlib import Path

import numpy as np
import pytest
from prove_samples import small

from fish_bag import read_dataset
from fish_report.robofish import main
from fish_study import scenario_groups
from fish_study.answer_tables import pair_tables
from fish_study.build import make_recordings
from fish_study.new_study import Asked
from fish_study.pair_recordings import (
    INJECTIONS,
    InjectionError,
    folder_name,
    make_pair,
    split,
    with_effects,
    write_trial_file,
)
from fish_study.runner import Job, run_scenario
from fish_study.scenario import Scenario, ScenarioError
from fish_study.scenario_groups import INJECTED
from fish_study.score import score_scenario
from fish_study.study import read_json
from fish_sysid.dataset.experiment import Experiment, build_experiment
from fish_sysid.dataset.synthetic import with_injection
from fish_sysid.diagnosis.change.comparable import FEWEST_WAYS

TOOL = (sys.executable, str(Path(__file__).with_name("fake_tool.py")))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten short recordings, as a user has them."""
    place = tmp_path_factory.mktemp("user") / "set"
    make_recordings(replace(small("null"), count=10), place)
    return place


@pytest.fixture(scope="module")
def trials(folder: Path):
    return list(read_dataset(folder))


def assert_same(a: Experiment, b: Experiment, tolerance: float) -> None:
    """All numbers agree, up to the rounding of stamps to nanoseconds."""
    for key in ("commands", "gyro", "accel", "encoder"):
        np.testing.assert_allclose(getattr(a, key), getattr(b, key), atol=tolerance)
    for f, g in zip(a.frames, b.frames, strict=True):
        np.testing.assert_allclose(f.t, g.t, atol=1e-8)
        np.testing.assert_allclose(f.pose, g.pose, atol=tolerance)
    for h, k in zip(a.headings, b.headings, strict=True):
        np.testing.assert_allclose(h.psi, k.psi, atol=tolerance)


def test_a_recording_that_is_written_again_says_the_same(trials, tmp_path: Path) -> None:
    for trial in trials[:3]:
        write_trial_file(tmp_path / "again" / trial.name, trial)
    again = list(read_dataset(tmp_path / "again"))
    assert_same(build_experiment(again), build_experiment(trials[:3]), 1e-6)


@pytest.mark.parametrize("name", INJECTED)
def test_an_injection_into_a_recording_is_that_on_the_grid(trials, name: str) -> None:
    values = scenario_groups.draw_effect(name, 1.0, np.random.default_rng(1))
    changed = [with_effects(trial, {name: values}) for trial in trials[:2]]
    on_the_grid = with_injection(build_experiment(trials[:2]), name, values)
    if name == "imu_misalignment":  # the IMU's own heading turns with it
        turned = tuple(replace(h, psi=h.psi + values["angle"]) for h in on_the_grid.headings)
        on_the_grid = replace(on_the_grid, headings=turned)
    found = build_experiment(changed)
    # positions may be shifted by a constant, in a current; late images are cut at another frame
    for f, g in zip(found.frames, on_the_grid.frames, strict=True):
        F = min(len(f.t), len(g.t))
        assert abs(len(f.t) - len(g.t)) <= 1
        apart = f.pose[-F:] - g.pose[-F:]
        np.testing.assert_allclose(apart - apart[0], 0.0, atol=1e-7)
    same = replace(found, frames=()), replace(on_the_grid, frames=())
    assert_same(*same, 2e-6)


def test_an_effect_that_cannot_be_put_in_is_refused(trials) -> None:
    with pytest.raises(InjectionError, match="payload"):
        with_effects(trials[0], {"payload": {"mass": 0.1}})
    assert tuple(INJECTIONS) == INJECTED


def test_old_and_new_are_of_different_runs_and_new_alone_has_the_effect(
    folder: Path, trials, tmp_path: Path, capsys
) -> None:
    values = {"x": 0.03, "y": -0.02}
    scenario = Scenario(
        "injected", 3, {"current": values}, plant="recordings", recordings=str(folder)
    )
    make_pair(scenario, tmp_path / "pair")
    old, new = (list(read_dataset(tmp_path / "pair" / name)) for name in ("old", "new"))
    assert comb(len(trials), len(new)) >= FEWEST_WAYS
    assert {t.name for t in old} | {t.name for t in new} == {t.name for t in trials}
    assert len(old) == 7
    assert len(new) == 3
    was = {t.name: t for t in trials}
    for trial in old:
        np.testing.assert_allclose(trial.camera.x, was[trial.name].camera.x, atol=1e-12)
    for trial in new:
        drift = trial.camera.y - was[trial.name].camera.y
        assert np.polyfit(trial.camera.t, drift, 1)[0] == pytest.approx(-0.02)
    with pytest.raises(ScenarioError, match="expected at least 10"):
        split(trials[:8], 0)
    asked = [
        "prove",
        "--recordings",
        str(tmp_path / "pair" / "old"),
        "--out",
        str(tmp_path / "few"),
    ]
    assert main(asked) == 1
    assert "got 7 recordings" in capsys.readouterr().err
    assert not (tmp_path / "few").exists()


def test_runs_whose_names_differ_after_a_dot_stay_apart() -> None:
    names = ["O_0.15", "O_0.20", "day_1/run", "day_2/run", "swim.mcap"]
    assert [folder_name(n) for n in names] == ["O_0.15", "O_0.20", "day_1_run", "day_2_run", "swim"]


def test_injections_and_changes_come_in_turn_a_fifth_of_them_nothing() -> None:
    random = np.random.default_rng(2)
    drawn = [scenario_groups.injected(random, k) for k in range(45)]
    names = [s.names for s in drawn]
    assert names.count(()) == 9
    assert {names.count((name,)) for name in INJECTED} == {4}
    pairs = [scenario_groups.mujoco_pair(random, k) for k in range(45)]
    assert sum(not s.names for s in pairs) == 9
    assert {len(s.names) for s in pairs} == {0, 1, 2}
    assert all(s.pair and (s.old, s.count, s.duration) == (18, 9, 12.0) for s in pairs)
    asked = Asked(6, ["mujoco-pair"], 5, 8.0, 1, frozenset({"trials", "duration"})).draw(1)
    assert {(s.old, s.count, s.duration) for s in asked} == {(10, 5, 8.0)}


def test_the_tool_is_given_two_folders(folder: Path, tmp_path: Path) -> None:
    scenario = Scenario("injected", 3, plant="recordings", recordings=str(folder))
    run_scenario(Job("a", scenario, tmp_path / "a", TOOL))
    seen = read_json(tmp_path / "a" / "result.json")["diagnosis"]["seen"]
    place = tmp_path / "a"
    assert seen["arguments"] == [
        str(place / "recordings" / "new"), "--baseline", str(place / "recordings" / "old"),
        "--out", str(place / "tool"),
    ]  # fmt: skip


def said(verdict: str, *effects: tuple[str, float, tuple[str, ...]]):
    """A result of a comparison: (name, probability, rivals) of each effect."""
    rows = [
        {
            "name": name,
            "kind": "physics",
            "parameters": {},
            "evidence": {"probability": p},
            "rivals": [{"name": rival, "probability": 0.1} for rival in rivals],
        }
        for name, p, rivals in effects
    ]
    content = {"verdict": "unexplained", "effects": rows, "change": {"verdict": verdict}}
    return {"seconds": 20.0, "error": "", "diagnosis": content}


def test_answers_are_counted_by_what_was_changed() -> None:
    hidden = Scenario("injected", 0, {"rudder_delay": {"delay": 0.08}}, plant="recordings")
    nothing = replace(hidden, effects={})
    answers = [
        (hidden, said("changed", ("rudder_delay", 0.95, ()))),
        (hidden, said("changed", ("rudder_lag", 0.6, ("rudder_delay",)))),
        (hidden, said("changed", ("current", 0.97, ()))),
        (hidden, said("unchanged")),
        (nothing, said("unchanged")),
        (nothing, said("not_comparable")),
    ]
    (table,) = pair_tables([score_scenario(*a) for a in answers])
    rows = {row[1]: row for row in table.rows}
    assert rows["rudder_delay"] == rows["any"][:1] + ["rudder_delay", *rows["any"][2:]]
    cells = [cell.split(" ")[0] for cell in rows["rudder_delay"][2:7]]
    assert cells == ["4", "3/4", "1/4", "2/4", "1/4"]
    assert rows["nothing"][3].startswith("0/2")
    assert rows["nothing"][7] == "1"
    assert rows["asked"][5] == "of each kind at least 90 %"
    assert pair_tables([score_scenario(small("null"), said("unchanged"))]) == []


def test_recordings_go_with_their_own_group_alone(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, nine = str(tmp_path / "out"), tmp_path / "nine"
    nine.mkdir()
    for recording in sorted(folder.iterdir())[:9]:
        (nine / recording.name).symlink_to(recording)
    for arguments, message in (
        (["--recordings", str(tmp_path), "--groups", "null"], "expected injected"),
        (["--recordings", str(tmp_path)], "no recording; expected a rosbag2 directory"),
        (
            ["--recordings", str(nine)],
            "got 9 recordings with commands and camera; expected at least 10",
        ),
        (["--groups", "injected"], "got None; expected a folder"),
        (["--recordings", str(tmp_path / "none")], "expected a folder of recordings"),
    ):
        assert main(["prove", *arguments, "--out", out]) == 1
        assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
