# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a closed loop, and the swims that are kept in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fish_control.control_law import ControlLimits
from fish_control.hand_tuned import HAND_TUNED
from fish_control.policy import Policy
from fish_study import (
    loop_folder,
    swim_cache,
)
from fish_study.close_loop import Plan, loop_scenario
from fish_study.loop_folder import prepare
from fish_study.study import StudyError
from fish_train.evaluation.candidates import Candidate, PolicyGains
from fish_train.evaluation.cells import Cell
from fish_train.evaluation.follow import ErrorSizes, RunMetrics
from fish_train.evaluation.study import Condition, Row
from fish_train.training.closed_loop_equations import Law

CELL = Cell("S", 0.1, 1)


def row(name: str, cross_track: float, speed: float = 0.02, cell: Cell = CELL) -> Row:
    sizes = ErrorSizes(cross_track, *(0.0,) * 4, speed, *(0.0,) * 4)
    return Row(name, "second plant", cell, RunMetrics(sizes, sizes, 1.0, ""))


def test_the_folder_of_a_loop_serves_its_own_scenario_alone(tmp_path: Path, monkeypatch) -> None:
    def plan(concealed: str = "wind", seed: int = 1, **changes) -> Plan:
        out = tmp_path / "out"
        return Plan(loop_scenario(concealed, seed, 3, 4.0), out / "recordings", out, **changes)

    made = []
    monkeypatch.setattr(
        loop_folder,
        "make_recordings",
        lambda scenario, folder: made.append(scenario) or folder.mkdir(),
    )
    prepare(plan())
    prepare(plan(search=8, trainings=5))  # goes on: neither changes what is kept
    assert made == [plan().scenario]
    assert (tmp_path / "out" / "recordings").exists()
    with pytest.raises(
        StudyError,
        match=r"holds a loop of seed 1, got 7; effects \{'wind': .*, got \{'ballast': .*: ask",
    ):
        prepare(plan("ballast", 7))
    for changed in (
        {"speeds": (0.1,)},
        {"training": ("--set", "latency=0.2")},
        {"nominal": tmp_path / "robot.yaml"},
    ):
        with pytest.raises(StudyError, match=next(iter(changed)).replace("nominal", "robot")):
            prepare(plan(**changed))
    (tmp_path / "out" / "loop.json").unlink()
    with pytest.raises(StudyError, match=r"has no loop.json.*choose another --out, or move"):
        prepare(plan())
    assert len(made) == 1


def test_recordings_of_a_loop_that_were_interrupted_are_made_again(
    tmp_path: Path, monkeypatch
) -> None:
    plan = Plan(loop_scenario("wind", 1, 3, 4.0), tmp_path / "recordings", tmp_path)

    def make(scenario, folder: Path, trials: int = 3) -> None:
        for k in range(trials):
            (folder / f"trial_{k:02d}").mkdir(parents=True)
        if trials < scenario.count:
            raise KeyboardInterrupt

    monkeypatch.setattr(
        loop_folder, "make_recordings", lambda scenario, folder: make(scenario, folder, 2)
    )
    with pytest.raises(KeyboardInterrupt):
        prepare(plan)
    assert not plan.recordings.exists()
    monkeypatch.setattr(loop_folder, "make_recordings", make)
    prepare(plan)
    assert len(list(plan.recordings.iterdir())) == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["loop.json", "recordings"]


def test_swims_that_are_kept_are_not_swum_again_and_those_of_other_gains_are(
    tmp_path, monkeypatch
) -> None:
    cells = [Cell("S", 0.1, seed) for seed in (1, 2, 3)]
    swum = []

    def swim(candidates, conditions, cells, jobs, report, keep):
        for c in candidates:
            if c.name == "b_1" and not swum[1:]:
                keep(
                    1, [row(c.name, 9.0, cell=cells[0])]
                )  # half of its runs, then the loop is stopped
                raise KeyboardInterrupt
            swum.append(c.name)
            keep(1, [row(c.name, len(swum) + 0.1, cell=cells[2])])
            keep(
                0, [replace(row(c.name, np.nan, cell=cell), condition="pool") for cell in cells[:2]]
            )

    def gains(steering: float) -> Candidate:
        policy = Policy.constant(HAND_TUNED._replace(steering_kp=steering))
        return Candidate("model", PolicyGains(policy))

    def each(given) -> list[Row]:
        return swim_cache.swim_each(given, Condition(), cells, 2, tmp_path, lambda _: None)

    monkeypatch.setattr(swim_cache, "run_study", swim)
    runs = {"a_1": gains(1.0), "b_1": gains(2.0)}
    with pytest.raises(KeyboardInterrupt):
        each(runs)
    assert [file.name for file in tmp_path.iterdir()] == ["a_1.json"]
    swum.append("stopped")
    first = each(runs)
    assert swum == ["a_1", "stopped", "b_1"]
    assert [r.cell for r in first] == cells * 2
    assert {r.candidate for r in first} == {"model"}
    sizes = [r.metrics.whole.cross_track_rmse for r in first]
    np.testing.assert_array_equal(sizes, [np.nan, np.nan, 1.1, np.nan, np.nan, 3.1])
    assert [r.condition for r in first[:3]] == ["pool", "pool", "second plant"]
    assert str(each(runs)) == str(first)
    assert len(swum) == 3
    each({**runs, "a_1": gains(1.5)})
    each(
        {
            **runs,
            "b_1": replace(
                gains(2.0), law=replace(Law(), limits=ControlLimits(curvature_gain=0.18))
            ),
        }
    )
    assert swum[3:] == ["a_1", "a_1", "b_1"]
