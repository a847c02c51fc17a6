# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gains from three models and from the plant itself: what is searched, kept and compared, and how much of the gap is closed."""

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
from fish_control.hand_tuned import HAND_TUNED, hand_tuned_policy
from fish_control.policy import Policy
from fish_report.errors import UserError
from fish_report.robofish import main
from fish_sim.robot import Robot
from fish_study import (
    close_loop,
    mujoco_plant,
    plant_swims,
)
from fish_study.close_loop import EVALUATION_SEEDS, Plan, loop_scenario, prepare
from fish_study.loop_page import (
    gap_share,
    loop_figure,
    loop_table,
    speed_table,
)
from fish_study.mujoco_plant import MujocoError, MujocoPlant
from fish_study.plant_swims import search
from fish_study.study import StudyError
from fish_study.verbs import prove
from fish_train.evaluation.candidates import Candidate, PolicyGains
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
    monkeypatch.setattr(close_loop, "prepare", lambda plan: plan.out.mkdir(exist_ok=True))
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

    monkeypatch.setattr(plant_swims, "run_study", swim)
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
    monkeypatch.setattr(
        plant_swims, "run_study", lambda *given: (swim if len(given) == 6 else try_gains)(*given)
    )
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


def test_the_folder_of_a_loop_serves_its_own_scenario_alone(tmp_path: Path, monkeypatch) -> None:
    def plan(concealed: str = "wind", seed: int = 1, **changes) -> Plan:
        out = tmp_path / "out"
        return Plan(loop_scenario(concealed, seed, 3, 4.0), out / "recordings", out, **changes)

    made = []
    monkeypatch.setattr(
        close_loop,
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
        close_loop, "make_recordings", lambda scenario, folder: make(scenario, folder, 2)
    )
    with pytest.raises(KeyboardInterrupt):
        prepare(plan)
    assert not plan.recordings.exists()
    monkeypatch.setattr(close_loop, "make_recordings", make)
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
        return plant_swims.swim_each(given, Condition(), cells, 2, tmp_path, lambda _: None)

    monkeypatch.setattr(plant_swims, "run_study", swim)
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


def test_the_gap_is_shared_out_by_hand() -> None:
    errors = {"nominal": (0.03, 0.02), "corrected": (0.014, 0.02), "true": (0.01, 0.02)}
    rows = [row(name, *sizes) for name, sizes in errors.items()]
    table = loop_table(rows)
    assert [r[2] for r in table.rows] == ["0%", "80%", "100%"]
    assert table.rows[1][4] == "no gap"
    assert [r[1] for r in table.rows] == ["30.0", "14.0", "10.0"]  # mm
    lost = replace(rows[1], metrics=replace(rows[1].metrics, failure="left the pool"))
    assert [r[6] for r in loop_table([rows[0], lost, rows[2]]).rows] == [
        "0 of 1",
        "1 of 1",
        "0 of 1",
    ]
    assert [box.y[0] for box in loop_figure(rows).data] == pytest.approx([30.0, 14.0, 10.0])


def test_a_run_that_diverges_is_no_gap_that_is_missing() -> None:
    rows = [
        row(name, size, size)
        for name, size in {"nominal": 0.03, "corrected": np.nan, "true": 0.01}.items()
    ]
    assert [r[2] for r in loop_table(rows).rows] == ["0%", "unknown: a run diverged", "100%"]
    rows = [
        replace(rows[0]),
        replace(rows[2], candidate="corrected"),
        replace(rows[1], candidate="true"),
    ]
    assert {r[2] for r in loop_table(rows).rows} == {"unknown: a run diverged"}


def test_every_speed_has_a_gap_of_its_own() -> None:
    slow = {"nominal": 0.05, "corrected": 0.05, "true": 0.04}
    fast = {"nominal": 0.03, "corrected": 0.012, "true": 0.01}
    rows = [row(n, size, cell=Cell("S", 0.1, 1)) for n, size in slow.items()]
    rows += [row(n, size, cell=Cell("S", 0.15, 1)) for n, size in fast.items()]
    table = speed_table(rows)
    assert table.header[1::2] == ["0.1 m/s: mm", "0.15 m/s: mm"]
    assert table.rows[1] == ["corrected", "50.0", "0%", "12.0", "90%"]


def test_the_interval_of_a_share_is_as_wide_as_runs_differ() -> None:
    random = np.random.default_rng(3)
    water = random.normal(0.0, 0.02, 24)  # common to the runs of a cell, so it drops out
    nominal, true = 0.08 + water[None], 0.05 + water[None]
    calm = gap_share(nominal, 0.056 + water[None], true)
    assert calm == pytest.approx((0.8, 0.8, 0.8), abs=1e-6)
    share, low, high = gap_share(nominal, 0.056 + water + random.normal(0.0, 0.01, (1, 24)), true)
    assert low < 0.8 < high
    assert low < share < high
    assert 0.1 < high - low < 0.6  # 4 standard errors of 0.01 / sqrt(24) / 0.03: 0.27
    assert np.isnan(gap_share(true, nominal, nominal)[0])
    unsure = np.array([[0.10, 0.01] * 12])  # a gap of 0.005 that other runs may not have
    assert gap_share(unsure, np.zeros((1, 24)), np.full((1, 24), 0.05))[1:] == (-np.inf, np.inf)


@pytest.mark.parametrize(("trainings", "runs"), [(6.0, 1.0), (6.0, 5.0), (3.0, 10.0)])
def test_the_interval_of_a_share_holds_what_it_says(trainings: float, runs: float) -> None:
    """Of three trainings and 24 runs, with these standard deviations in mm; resampling them covered 77 to 95 %."""
    random = np.random.default_rng(1)

    def swum(mean: float, count: int, scatter: float) -> np.ndarray:
        return (
            mean
            + water
            + random.normal(0.0, scatter, (count, 1))
            + random.normal(0.0, runs, (count, 24))
        )

    share, hits = 0.9, 0
    for _ in range(600):
        water = random.normal(0.0, 20.0, 24)
        models = (
            swum(73.0, 3, trainings),
            swum(73.0 - 26.0 * share, 3, trainings),
            swum(47.0, 1, 0.0),
        )
        _, low, high = gap_share(*models)
        hits += low <= share <= high
    assert hits / 600 >= 0.94


def test_trainings_that_differ_widen_the_interval_and_all_count() -> None:
    nominal, true = np.full((3, 12), 0.08), np.full((1, 12), 0.05)
    own = np.array([0.05, 0.056, 0.062])[:, None] + np.zeros(12)
    share, low, high = gap_share(nominal, own, true)
    wide = 4.303 * 0.006 / np.sqrt(3.0) / 0.03  # t of two degrees of freedom
    assert (share, low, high) == pytest.approx((0.8, 0.8 - wide, 0.8 + wide), abs=1e-3)
    cells = [Cell("S", 0.1, seed) for seed in (1, 2)]
    rows = [
        row(n, size, cell=c)
        for n, sizes in {
            "nominal": (0.05, 0.05),
            "corrected": (0.02, 0.04),
            "true": (0.03,),
        }.items()
        for size in sizes
        for c in cells
    ]
    table = loop_table(rows)
    assert [r[1] for r in table.rows] == ["50.0", "30.0", "30.0"]
    assert table.rows[1][2].startswith("100% (")
    assert [r[5] for r in table.rows] == ["50.0, 50.0", "20.0, 40.0", "30.0"]
    assert [r[6] for r in table.rows] == ["0 of 4", "0 of 4", "0 of 2"]
    rows = [
        row(n, size, cell=c)
        for n, sizes in {
            "nominal": (0.05, 0.02),
            "corrected": (0.02, 0.04),
            "true": (0.03,),
        }.items()
        for size in sizes
        for c in cells
    ]
    assert [r[2] for r in loop_table(rows).rows] == ["0%", "100% (anything: no sure gap)", "100%"]
