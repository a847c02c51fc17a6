# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gains from three models and from the plant itself: what is searched and what is compared."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fish_control.control_law import ControlLimits
from fish_control.gains_file import write_gains_file
from fish_control.hand_tuned import hand_tuned_policy
from fish_report.errors import UserError
from fish_report.robofish import main
from fish_sim.robot import Robot
from fish_study import (
    close_loop,
    gain_search,
    loop_folder,
    mujoco_plant,
    swim_cache,
)
from fish_study.close_loop import EVALUATION_SEEDS, Plan, loop_scenario
from fish_study.gain_search import search
from fish_study.mujoco_plant import MujocoError, MujocoPlant
from fish_study.verbs import prove
from fish_train.evaluation.cells import Cell
from fish_train.evaluation.follow import ErrorSizes, RunMetrics
from fish_train.evaluation.open_loop import law_of_robot
from fish_train.evaluation.plant import FishSimPlant
from fish_train.evaluation.study import Condition, Row
from fish_train.training.closed_loop_equations import Law

CELL = Cell("S", 0.1, 1)


def row(name: str, cross_track: float, speed: float = 0.02, cell: Cell = CELL) -> Row:
    sizes = ErrorSizes(cross_track, *(0.0,) * 4, speed, *(0.0,) * 4)
    return Row(name, "second plant", cell, RunMetrics(sizes, sizes, 1.0, ""))


def test_what_the_loop_cannot_conceal_is_said() -> None:
    assert loop_scenario("nothing", 1, 3, 4.0).effects == {}
    with pytest.raises(ValueError, match="concealed: got 'storm'; expected one of nothing, "):
        loop_scenario("storm", 1, 3, 4.0)


def test_the_command_says_how_long_the_search_is_and_how_many_trainings_there_are(
    tmp_path, monkeypatch
) -> None:
    plans = []

    def loop(plan, jobs, say):
        plans.append(plan)
        return [row(n, e) for n, e in {"nominal": 0.03, "corrected": 0.014, "true": 0.01}.items()]

    monkeypatch.setattr(prove, "_need", lambda *_: None)
    monkeypatch.setattr(loop_folder, "prepare", lambda plan: plan.out.mkdir(exist_ok=True))
    monkeypatch.setattr(close_loop, "close_loop", loop)
    out = tmp_path / "out"
    asked = [
        "prove",
        "--close-loop",
        "wind",
        "--out",
        str(out),
        "--trainings",
        "6",
        "--search",
        "5",
    ]
    assert main(asked) == 0
    assert [(p.trainings, p.search, p.scenario.effects) for p in plans] == [
        (6, 5, loop_scenario("wind", 1, 12, 20.0).effects)
    ]
    assert sorted(p.name for p in out.iterdir()) == ["loop.html", "runs.csv"]
    assert main([*asked, "--trainings", "0"]) == 1
    assert len(plans) == 1


class Engine:
    """Stands in for MuJoCo: a fish drifts ahead by 1 mm a step, and bursts when its rotor is driven faster than 100 rad/s."""

    def __init__(self) -> None:
        joint, body = SimpleNamespace(qposadr=[3]), SimpleNamespace(id=0)
        model = SimpleNamespace(
            joint=lambda _: joint,
            body=lambda _: body,
            geom=lambda _: body,
            geom_fluid=np.zeros((1, 12)),
            opt=SimpleNamespace(wind=np.zeros(3)),
        )
        self.mjtObj = SimpleNamespace(mjOBJ_GEOM=5)
        self.MjModel = SimpleNamespace(from_xml_string=lambda _: model)

    def MjData(self, model) -> SimpleNamespace:
        sizes = {"qpos": 4, "qvel": 4, "ctrl": 2, "sensordata": 6, "xfrc_applied": (1, 6)}
        sizes["geom_xmat"] = (1, 9)
        return SimpleNamespace(
            **{k: np.zeros(n) for k, n in sizes.items()},
            warning=SimpleNamespace(number=np.zeros(8, int)),
        )

    def mj_resetData(self, model, data) -> None:
        data.qpos[:], data.warning.number[:] = 0.0, 0

    def mj_objectVelocity(self, model, data, kind, number, motion, local) -> None:
        motion[:] = 0.0

    def mj_step(self, model, data, steps) -> None:
        data.qpos[0] += 1e-3 * steps
        data.warning.number[6] += data.ctrl[0] > 100.0


def test_a_fish_that_becomes_unstable_is_a_run_that_diverged_and_the_others_swim_on(
    monkeypatch,
) -> None:
    monkeypatch.setattr(mujoco_plant, "_mujoco", Engine)
    plant = MujocoPlant("", 3, 0.0, np.random.default_rng(0))
    swimmer = close_loop.Swimmer(plant)
    swimmer.reset(np.zeros((3, 3)))
    calm, fast = np.zeros((3, 2)), np.array([[0.0, 0.0], [200.0, 0.0], [0.0, 0.0]])
    for commands in (calm, fast, calm):
        swimmer.step(commands)
    assert np.isnan(swimmer.motion[1]).all()
    np.testing.assert_allclose(swimmer.motion[[0, 2], 0], 3 * 20 * 1e-3)
    swimmer.reset(np.zeros((3, 3)))
    assert np.isfinite(swimmer.motion).all()
    with pytest.raises(
        MujocoError, match="the engine became unstable"
    ):  # no data set is made of it
        plant.step(fast)


def test_a_search_on_the_plant_goes_on_where_it_was_stopped(tmp_path, monkeypatch) -> None:
    swum = []

    def swim(candidates, conditions, cells, jobs):
        assert not conditions[0].fused
        if len(swum) == 7 and "stop" in cells:
            raise KeyboardInterrupt
        gains = candidates[0].gains.policy.gains(np.zeros(0))
        swum.append(gains)
        sizes = SimpleNamespace(
            cross_track_rmse=abs(np.log(gains.steering_kp)), speed_rmse=gains.speed_kp
        )
        return [SimpleNamespace(metrics=SimpleNamespace(whole=sizes))]

    monkeypatch.setattr(gain_search, "run_study", swim)
    plant = Condition(name="second plant")
    whole = search(plant, (), 20, 1, tmp_path / "whole.json")
    expected, swum[:] = list(swum), []
    with pytest.raises(KeyboardInterrupt):
        search(plant, ("stop",), 20, 1, tmp_path / "again.json")
    assert search(plant, (), 20, 1, tmp_path / "again.json") == whole
    assert swum == expected
    assert len(swum) >= 15


def test_the_search_never_sees_the_runs_that_are_judged(tmp_path, monkeypatch) -> None:
    """Verbs are stood in for: what they are given and what is swum is what is asked here."""
    verbs, searched, judged = [], [], []

    def verb(name: str, *arguments: str) -> None:
        verbs.append((name, *arguments))
        out = Path(arguments[arguments.index("--out") + 1])
        seed = arguments[arguments.index("--seed") + 1] if name == "train" else ""
        weights = f"seed_{seed}/gains.safetensors"
        made = out / {"train": weights, "identify": "robot.yaml", "diagnose": "model.yaml"}[name]
        made.parent.mkdir(parents=True, exist_ok=True)
        write_gains_file(made, hand_tuned_policy())
        if name == "train" and "corrected" in str(out):
            raise UserError("a recipe that is not swum to its end")

    own = replace(Law(), limits=ControlLimits(curvature_gain=0.18))
    laws = {}

    def try_gains(candidates, conditions, cells, jobs):
        searched.extend(cells)
        assert all(c.law == own for c in candidates)
        return [row(c.name, 0.01, cell=cell) for c in candidates for cell in cells]

    def swim(candidates, conditions, cells, jobs, report, keep):
        assert conditions[0].fused
        report(3, 20)
        judged.extend(cells)
        laws.update({c.name: c.law for c in candidates})
        for c in candidates:
            keep(0, [row(c.name, 0.01, cell=cell) for cell in cells])

    monkeypatch.setattr(close_loop, "_verb", verb)
    monkeypatch.setattr(gain_search, "run_study", try_gains)
    monkeypatch.setattr(swim_cache, "run_study", swim)
    monkeypatch.setattr(close_loop, "_plant_law", lambda _: own)
    plan = Plan(
        loop_scenario("wind", 1, 3, 4.0), tmp_path / "recordings", tmp_path / "out", search=8
    )
    said = []
    rows = close_loop.close_loop(plan, 2, said.append)
    assert "swum: 3 of 20 batches" in said
    count = Counter(r.candidate for r in rows)
    assert {count[n] / count["true"] for n in ("nominal", "refitted", "corrected")} == {3.0}
    assert list(dict.fromkeys(r.candidate for r in rows)) == [
        "nominal",
        "refitted",
        "corrected",
        "true",
    ]
    assert "trained: 9 of 9" in said
    assert {v[0] for v in verbs[:2]} == {"identify", "diagnose"}
    assert {v[0] for v in verbs[2:]} == {"train"}
    given = {Path(v[v.index("--out") + 1]).name: v for v in verbs[2:]}
    runs = Counter(
        (Path(v[v.index("--out") + 1]).name, v[v.index("--seed") + 1]) for v in verbs[2:]
    )
    assert runs == Counter(product(given, "123"))  # each model from the same seeds
    assert len({v[v.index("--set") :] for v in verbs[2:]}) == 1  # all trained alike
    assert "--robot" not in given["nominal"]
    assert str(tmp_path / "out" / "identify" / "robot.yaml") in given["refitted"]
    assert str(tmp_path / "out" / "diagnose" / "model.yaml") in given["corrected"]
    assert laws["true"] == own
    assert laws["corrected_1"].limits == ControlLimits()
    assert {c.seed for c in judged} == set(EVALUATION_SEEDS)
    assert {(c.path, c.speed) for c in judged} == {(c.path, c.speed) for c in searched}
    assert {c.seed for c in searched}.isdisjoint(EVALUATION_SEEDS)
    done = len(verbs)
    close_loop.close_loop(plan, 2, lambda _: None)
    assert len(verbs) == done  # what is there is used
    (
        tmp_path / "out" / "training" / "nominal" / "seed_2" / "gains.safetensors"
    ).unlink()  # was stopped
    close_loop.close_loop(replace(plan, trainings=4), 2, lambda _: None)
    again = [(Path(v[v.index("--out") + 1]).name, v[v.index("--seed") + 1]) for v in verbs[done:]]
    assert sorted(again) == [
        ("corrected", "4"),
        ("nominal", "2"),
        ("nominal", "4"),
        ("refitted", "4"),
    ]
    assert all("--resume" in v and "--overwrite" not in v for v in verbs[done:])


@pytest.mark.parametrize(
    ("concealed", "kept"), [("wind", set()), ("servo_filter", {"servo_filter"})]
)
def test_the_plants_own_feed_forward_is_of_still_water(concealed, kept, monkeypatch) -> None:
    """The simulator stands in for MuJoCo here."""
    asked = []

    def of(scenario, count, random):
        asked.append(set(scenario.effects))
        return FishSimPlant([Robot()] * count, range(count))

    monkeypatch.setattr(close_loop, "MujocoPlant", SimpleNamespace(of=of))
    assert close_loop._plant_law(loop_scenario(concealed, 1, 3, 4.0)) == law_of_robot(Robot())
    assert asked == [kept]
