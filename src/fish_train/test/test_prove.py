"""The blind study: labels that cannot be changed afterwards, runs that go on, scores that are right by hand."""

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.effects import EFFECTS
from fish_sim.ops import NUMPY
from fish_sim.scheme import default_scheme
from fish_train.commands.main import main
from fish_train.diagnose.locate import MissingForce
from fish_train.diagnose.own_force import acting, f1, own_force, regimes
from fish_train.diagnose.vocabulary import candidates
from fish_train.identify.experiment import build_experiment
from fish_train.identify.filter_types import Noise
from fish_train.identify.fit import evaluate
from fish_train.prove import groups, tool_version
from fish_train.prove.build import make_readings, make_world
from fish_train.prove.judge import judged_table, rivals_table
from fish_train.prove.mujoco_plant import MujocoPlant, model_text
from fish_train.prove.nulls import null_table
from fish_train.prove.oracle import Sight, as_experiment, detects, with_truth
from fish_train.prove.other_forms import OTHER_FORMS
from fish_train.prove.outside import OUTSIDE, known_to_the_plant
from fish_train.prove.runner import run_study
from fish_train.prove.score import score_world
from fish_train.prove.seal import Sealed, broken_seals, seal_label
from fish_train.prove.study import Study, StudyError, read_json
from fish_train.prove.tables import ASKED, Share, calibration, choice, power, smallest_error
from fish_train.prove.tool_version import tool_digest
from fish_train.prove.truths import truths_of
from fish_train.prove.where import dof_overlap, overlap, stated_range, stated_times, true_push
from fish_train.prove.world import World
from fish_train.recordings import read_dataset
from fish_train.reports.prove_page import write_prove_page

TOOL = (sys.executable, str(Path(__file__).with_name("fake_tool.py")))


def small(group: str, number: int = 0, **changes) -> World:
    world = groups.GROUPS[group](np.random.default_rng(5), number)
    scheme = default_scheme(3)  # the kernel of other tests
    changes = {"method": scheme.method, "substeps": scheme.substeps, **changes}
    return replace(world, count=3, duration=4.0, **changes)


def test_labels_cannot_be_changed_after_the_seal() -> None:
    sealed = {"a": seal_label({"effects": {"current": {"x": 0.1}}}), "b": seal_label({"effects": {}})}
    seals = {name: s.seal for name, s in sealed.items()}
    assert broken_seals(seals, sealed) == []
    assert seal_label({"effects": {}}).seal != sealed["b"].seal  # the salt hides equal labels
    changed = {**sealed, "a": Sealed(sealed["a"].salt, {"effects": {"current": {"x": 0.2}}})}
    assert broken_seals(seals, changed) == ["a"]
    assert broken_seals(seals, {"a": sealed["a"]}) == ["b"]


def test_worlds_are_drawn_from_the_seed_alone() -> None:
    names = list(groups.GROUPS)
    worlds = groups.draw_worlds(60, names, 7)
    assert worlds == groups.draw_worlds(60, names, 7) != groups.draw_worlds(60, names, 8)
    assert {w.group for w in worlds} == set(names)
    assert all(World.of(w.label()) == w for w in worlds)
    hidden = {groups.single(np.random.default_rng(0), k).names[0] for k in range(len(candidates()) + 1)}
    assert hidden == {*candidates(), *OTHER_FORMS}
    with pytest.raises(ValueError, match="known: single"):
        groups.draw_worlds(3, ["nonsense"], 0)


def test_no_outside_effect_is_in_the_vocabulary() -> None:
    before = dict(EFFECTS)
    assert not set(OUTSIDE) & set(candidates())
    with known_to_the_plant():
        assert set(OUTSIDE) < set(EFFECTS)
    assert before == EFFECTS


def test_another_form_of_a_name_counts_as_that_name() -> None:
    flow, p = OTHER_FORMS["vortex"].water, SimpleNamespace(speed=0.04, at_x=0.3, at_y=-0.1, core=0.5)
    velocity, ((a, b), (c, d)) = flow(p, 0.3, 0.4, None, NUMPY)  # a core above its middle
    assert velocity == pytest.approx((-0.04, 0.0), abs=1e-15) and a + d == pytest.approx(0.0, abs=1e-15)
    h = 1e-6
    up, right = (flow(p, 0.2 + dx, 0.1 + dy, None, NUMPY)[0] for dx, dy in ((0.0, h), (h, 0.0)))
    down, left = (flow(p, 0.2 - dx, 0.1 - dy, None, NUMPY)[0] for dx, dy in ((0.0, h), (h, 0.0)))
    (a, b), (c, d) = flow(p, 0.2, 0.1, None, NUMPY)[1]
    slopes = [(u - v) / (2 * h) for u, v in zip((*right, *up), (*left, *down), strict=True)]
    assert slopes == pytest.approx([a, c, b, d], abs=1e-9)
    world = groups.single(np.random.default_rng(0), len(candidates()))
    assert world.names == ("vortex",) and truths_of(world) == ("nonuniform_current",)
    assert truths_of(small("single")) is None


def test_a_study_is_sealed_first_goes_on_and_opens(tmp_path) -> None:
    worlds = [small("single"), small("null"), small("outside", 4)]
    study = Study.create(tmp_path / "study", worlds, {"seed": 1, "began": "today", "command": "test"})
    seals = read_json(study.folder / "seals.json")
    assert (study.folder / "sealed.json").stat().st_mode & 0o077 == 0
    with pytest.raises(StudyError, match="3 worlds have no result"):
        study.reveal()
    with pytest.raises(StudyError, match="already"):
        Study.create(tmp_path / "study", worlds, {})
    left = study.place("world_0000") / "recordings" / "half"  # of a run that was killed
    left.mkdir(parents=True)
    done: list[str] = []
    with pytest.raises(StudyError, match="world_0002: the tool was stopped"):
        run_study(study, 1, done.append, TOOL)
    assert done == ["world_0000", "world_0001"] and study.open_worlds == ["world_0002"]
    run_study(study, 1, done.append, TOOL)
    assert done[2:] == ["world_0002"]
    run_study(study, 1, lambda name: pytest.fail(f"{name} ran twice"), TOOL)
    results = study.results
    told = results["world_0000"]["diagnosis"]["seen"]
    assert told["trials"] == ["trial_00", "trial_01", "trial_02"]
    place = study.place("world_0000").resolve()
    assert told["arguments"] == [str(place / "recordings"), "--out", str(place / "tool")]
    assert "exit status 3: cannot" in results["world_0001"]["error"]
    opened = study.reveal()
    assert list(opened.values()) == worlds
    assert read_json(study.folder / "seals.json") == seals
    scores = [score_world(world, results[name]) for name, world in opened.items()]
    assert [s.verdict for s in scores] == ["no_mismatch", "failed", "no_mismatch"]
    write_prove_page(tmp_path / "report.html", [study.about], scores)
    page = (tmp_path / "report.html").read_text()
    assert (
        "exit status 3: cannot" in page
        and "Asked and measured" in page
        and "http" not in page.split("plotly.js")[0].split("<script")[0]
    )
    other = Study.create(tmp_path / "other", worlds, {"seed": 2, "began": "later", "command": "again"})
    pool = ["prove", "--pool", str(study.folder), str(other.folder), "--out", str(tmp_path / "pooled")]
    assert main(pool) == 1  # nothing is said before every label may be opened
    with pytest.raises(StudyError, match="stopped"):
        run_study(other, 1, done.append, TOOL)
    run_study(other, 1, done.append, TOOL)
    assert main(pool) == 0
    page = (tmp_path / "pooled" / "report.html").read_text()
    assert "6 worlds, 4 of them with something hidden; seed 1, today; seed 2, later" in page
    newer = Study.create(tmp_path / "newer", worlds, {"tool": "0123456789abcdef"})
    assert main([*pool[:2], str(study.folder), str(newer.folder), *pool[4:]]) == 1
    with pytest.raises(StudyError, match="got version 0123456789abcdef of the tool, expected"):
        newer.check_tool(tool_digest())
    (study.folder / "seals.json").write_text('{"world_0000": "0"}')
    with pytest.raises(StudyError, match="not what was sealed"):
        study.reveal()


def test_a_study_that_is_killed_leaves_no_tool_behind(tmp_path: Path) -> None:
    Study.create(tmp_path / "study", [small("null")], {"seed": 1})
    tool = "import os, sys, time, pathlib as p; (p.Path(sys.argv[1]) / 'pid').write_text(str(os.getpid())); time.sleep(600)"
    study = f"""from pathlib import Path
from fish_train.prove.runner import run_study
from fish_train.prove.study import Study
run_study(Study(Path({str(tmp_path / "study")!r})), 1, print, ({sys.executable!r}, "-c", {tool!r}))
"""
    with subprocess.Popen([sys.executable, "-c", study]) as run:
        note = tmp_path / "study/worlds/world_0000/recordings/pid"
        assert comes_true(lambda: note.exists() and note.read_text())
        run.kill()
    assert comes_true(lambda: not Path(f"/proc/{note.read_text()}").exists())


def test_the_tool_s_version_is_that_of_its_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = tool_digest()
    assert len(whole) == 16 and whole == tool_digest()
    monkeypatch.setattr(tool_version, "PARTS", tool_version.PARTS[:-1])
    assert tool_digest() != whole


def test_the_tool_s_version_leaves_out_what_no_answer_depends_on(tmp_path: Path) -> None:
    (tmp_path / "nodes").mkdir()
    (tmp_path / "methods").mkdir()
    for file in ("nodes/pacer.py", "methods/heun.py", "step.py", "notes.txt"):
        (tmp_path / file).write_text("x = 1\n")
    assert sorted(name for name, _ in tool_version._texts(tmp_path)) == ["methods/heun.py", "step.py"]


def test_a_tool_is_the_same_after_a_word_about_it_and_another_after_a_number():
    before = tool_version.code('"""Steps."""\n\nSTEP = 0.1  # s\n\n\ndef f():\n    """Twice."""\n')
    assert tool_version.code('STEP = (\n    0.1\n)\ndef f():\n    """Thrice."""\n') == before
    assert tool_version.code("STEP = 0.2\ndef f(): pass\n") != before


def comes_true(condition: Callable[[], object], patience: float = 60.0) -> bool:
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(condition())


def test_recordings_say_what_the_instruments_read(tmp_path) -> None:
    world = small("single", encoder=True)
    make_world(world, tmp_path / "set")
    data = read_dataset(tmp_path / "set")
    assert not [p for trial in data for p in trial.problems if p.severity != "info"]
    read, direct = build_experiment(list(data)), as_experiment(make_readings(world), True)
    for key in ("commands", "gyro", "accel", "encoder"):
        assert np.allclose(
            getattr(read, key)[:-1], getattr(direct, key)[: len(read.commands) - 1], atol=1e-9, equal_nan=True
        )
    for a, b in zip(read.frames, direct.frames, strict=True):
        turns = np.round((a.pose - b.pose) / (2.0 * np.pi)) * [
            0.0,
            0.0,
            2.0 * np.pi,
        ]  # a heading may wrap elsewhere
        assert np.allclose(a.t, b.t, atol=1e-8) and np.allclose(a.pose - turns, b.pose, atol=1e-9)


def test_the_hidden_effect_changes_the_motion_and_the_rest_stays() -> None:
    hidden = small("outside", 4)
    without = replace(hidden, effects={})
    a, b, again = (make_readings(w)[0] for w in (hidden, without, hidden))
    assert np.array_equal(a.truth, again.truth)
    assert np.abs(a.truth - b.truth).max() > 1e-3


def diagnosis(*effects, verdict="missing_physics", rivals=()) -> dict:
    rows = [
        {
            "name": name,
            "kind": kind,
            "evidence": {"probability": p},
            "rivals": [{"name": n, "probability": 0.1} for n in rivals],
            "parameters": {"x": {"value": 0.031, "std": 0.0001}},
        }
        for name, kind, p in effects
    ]
    ranking = [{"name": "current", "gain": 9.0}, {"name": "quadratic_drag", "gain": 10.0}]
    fit = {"with_effects": {"rms": {}}, "refitted": {"rms": {"2 s": {"position_m": 0.010}}}}
    errors = {"current": 0.012, "wall_effect": 0.009}
    refitted = [{"name": n, "held_out_rms": {"2 s": {"position_m": e}}} for n, e in errors.items()]
    content = {"verdict": verdict, "effects": rows, "fit": fit, "ranking": ranking, "refitted": refitted}
    return {"seconds": 60.0, "diagnosis": content}


def test_scores_by_hand() -> None:
    current = World("single", 1, {"current": {"x": 0.03, "y": 0.0}})
    right = score_world(current, diagnosis(("current", "physics", 0.97), rivals=("tether",)))
    assert right.top1 and right.in_set and right.exact and not right.confident_wrong
    assert right.answered == {"current", "tether"}
    assert [p.within for p in right.parameters] == [True]  # ten standard errors, but 3 %
    wrong = score_world(current, diagnosis(("tether", "physics", 0.97), rivals=("current",)))
    assert not wrong.top1 and wrong.in_set and wrong.confident_wrong and wrong.false_names == ("tether",)
    nothing = score_world(World("null", 2), diagnosis(verdict="no_mismatch"))
    assert not nothing.alarm and nothing.exact and not nothing.in_set
    odd = score_world(World("outside", 3, {"jet": {"x": 0.1}}), diagnosis(verdict="unexplained"))
    assert odd.unnamed and odd.alarm and not odd.truth
    pair = World("two", 4, {"current": {}, "rudder_offset": {}})
    half = score_world(pair, diagnosis(("current", "physics", 0.6)))
    assert half.top1 and not half.in_set and not half.exact
    lens = score_world(World("sensor", 5, {"camera_scale": {}}), diagnosis(("payload", "physics", 0.99)))
    assert lens.called_physics
    lost = diagnosis(("current", "physics", 0.97))  # what is not finite is null in the file
    lost["diagnosis"]["ranking"][1]["gain"] = lost["diagnosis"]["refitted"][1]["held_out_rms"]["2 s"][
        "position_m"
    ] = None
    assert choice(score_world(current, lost), lambda *_: 1.0) == "current"
    lost["diagnosis"]["fit"]["refitted"]["rms"]["2 s"]["position_m"] = None
    assert smallest_error(score_world(current, lost)) == "current"
    assert choice(right, lambda name, _: 3.0 if name == "quadratic_drag" else 1.0) == "current"
    assert choice(right, lambda *_: 20.0) is None
    assert smallest_error(right) == "wall_effect"
    assert smallest_error(replace(right, held_out={"current": 0.011})) is None
    bins = calibration([right, wrong, half])
    assert [(b.low, b.right.k, b.right.n) for b in bins] == [(0.5, 1, 1), (0.95, 1, 2)]


def test_gains_of_null_worlds_by_hand() -> None:
    worlds = [World("null", k, links=links) for k, links in enumerate((3, 3, 5))]
    scores = [score_world(w, diagnosis(verdict="no_mismatch")) for w in worlds]
    scores[0] = replace(scores[0], ranking={"current": 2.0, "tether": -np.inf})
    table = null_table([*scores, score_world(World("single", 9, {"current": {}}), diagnosis())])
    assert table.rows == [["3", "1", "2", "6.0", "10.0"], ["5", "1", "1", "10.0", "10.0"]]
    assert "0.6 in the median" in table.note  # the larger of two chi square / 2 with one degree of freedom
    assert null_table([]) is None


def test_share_has_the_exact_interval() -> None:
    low, high = Share(0, 100).interval
    assert low == 0.0 and np.isclose(high, 1.0 - 0.025 ** (1 / 100))
    assert str(Share(0, 0)) == "–"
    assert len({a.what for a in ASKED}) == len(ASKED)


def test_power_counts_per_strength() -> None:
    scores = []
    for i, (strength, name) in enumerate([(0.5, "tether"), (0.5, "current"), (1.0, "current")]):
        world = World("ladder", i, {"current": {"x": 0.03}}, strength)
        scores.append(score_world(world, diagnosis((name, "physics", 0.9))))
    steps = power(scores, {0: True, 1: True, 2: False})
    assert [(p.strength, p.found.k, p.found.n, p.oracle.k) for p in steps] == [(0.5, 1, 2, 2), (1.0, 1, 1, 0)]


def test_overlap_of_times_and_degrees_of_freedom() -> None:
    acts, names = np.zeros((800, 2), dtype=bool), ["trial_00", "trial_01"]
    acts[200:400, 1] = True
    hit = [{"trial": "trial_01", "from": 2.0, "to": 4.0}, {"trial": "elsewhere", "from": 0.0, "to": 8.0}]
    assert overlap(stated_times(hit, names, 800), acts) == 1.0
    assert overlap(stated_times([{**hit[0], "to": 6.0}], names, 800), acts) == 0.5
    assert overlap(stated_times([{**hit[0], "trial": "trial_00"}], names, 800), acts) == 0.0
    assert f1(stated_times([{**hit[0], "to": 6.0}], names, 800), acts) == pytest.approx(2.0 / 3.0)
    assert dof_overlap({"surge": 0.7, "yaw": 0.3}, {"surge": 0.5, "sway": 0.5}) == 0.5


def test_a_localised_effect_is_seen_where_it_acts() -> None:
    """A fish that swims to a wall, with drag there: the interval before the wall, and the distance as what tells it."""
    effects = {"wall_effect": {"k": 2.5, "length": 0.2}}
    world = World("single", 3, effects, count=3, duration=10.0)
    experiment = as_experiment(make_readings(world), True)
    push = true_push(world, experiment)
    assert push is not None
    acts = acting(push, np.array(Noise().wrench))
    near = push.covariates["wall_distance"]
    assert 0.02 < acts.mean() < 0.8 and near[acts].mean() < near[~acts].mean()
    assert stated_range(regimes(push, np.array(Noise().wrench)), push.covariates)[acts].mean() > 0.5
    assert true_push(World("single", 1, {"current": {"x": 0.03}}), experiment) is None


def test_the_own_force_of_a_drag_is_its_equation() -> None:
    """-k |u| u on the head, from the accelerations with and without it."""
    world = World(
        "single", 3, {"quadratic_drag": {"surge": 0.5, "sway": 0.0, "yaw": 0.0}}, count=2, duration=4.0
    )
    experiment = as_experiment(make_readings(world), True)
    hypothesis, theta = with_truth(world, world.names)
    push = own_force(evaluate(hypothesis, theta, experiment, Noise()), "quadratic_drag", experiment)
    u = push.covariates["surge_speed"]
    np.testing.assert_allclose(push.wrench[..., 0], -0.5 * np.abs(u) * u, atol=1e-6)
    np.testing.assert_allclose(push.wrench[..., 1:], 0.0, atol=1e-6)


def test_the_oracle_and_the_rivals_by_hand() -> None:
    def sight(gain: float) -> Sight:
        return Sight(gain, 1, [[0.02] * 3, [0.04] * 3, [0.1] * 3], [[0.01] * 3, [0.02] * 3, [0.05] * 3])

    assert detects(sight(3.0), []) and not detects(
        sight(2.6), []
    )  # chi square, one parameter, 2 %: 2.71 nats
    assert not detects(sight(3.0), [sight(100.0)] * 25)  # but not where nothing looks like that too
    world = World("single", 1, {"current": {"x": 0.03}})
    answer = diagnosis(("current", "physics", 0.9))
    answer["diagnosis"]["fit"]["with_effects"]["rms"] = {"2 s": {"position_m": 0.022}}
    right, null = score_world(world, answer), score_world(World("null", 2), diagnosis(verdict="no_mismatch"))
    judged = {
        1: {"overlap": 0.5, "f1": 0.6, "range_f1": None, "dof": 0.7},
        2: {"overlap": None, "f1": None, "dof": None},
    }
    nameless = [
        score_world(World("outside", seed, {"jet": {"x": 0.03}}), diagnosis(verdict=verdict))
        for seed, verdict in ((3, "unexplained"), (4, "no_mismatch"), (5, "no_mismatch"))
    ]
    sights, seen = {1: sight(9.0), 2: sight(0.0)}, {1: True, 3: True, 4: True, 5: False}
    table = judged_table([right, null, *nameless], judged, sights, seen)
    assert [row[2] for row in table.rows] == [
        "100% of 1",
        str(Share(1, 2)),
        "1.10 (1 worlds)",
        "0.55 (1 worlds)",
        "0.70 (1 worlds)",
        "0.50 (1 worlds)",
        "0.60 (1 worlds)",
        "–",
    ]
    said = {
        1: {"sindy": "tether", "sindy_r2": 0.4, "neural_r2": 0.3},
        2: {"sindy": None, "sindy_r2": 0.0, "neural_r2": 0.0},
    }
    rows = rivals_table([right, null], said).rows
    assert rows[0][1].startswith("1/1") and rows[1][1].startswith("0/1") and rows[1][2].startswith("0/1")


def test_a_competitor_finds_the_law_it_was_shown() -> None:
    pytest.importorskip("pysindy")
    from fish_train.prove.competitors import _sparse

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
    assert name == "current" and share < 1.0
    assert _sparse(force(0.0), force(0.0))[0] is None


@pytest.fixture(scope="module")
def basin():
    """The second plant, nothing concealed, still water."""
    pytest.importorskip("mujoco")
    return lambda count, **effects: MujocoPlant(
        model_text(5, {}, effects), count, 0.0, np.random.default_rng(0)
    )


def drive(plant, rudder: np.ndarray, seconds: float) -> np.ndarray:
    """(T, M, 6) motion at 10 to 15 % throttle."""
    plant.reset(np.zeros((len(rudder), 3)))
    rows = []
    for k in range(round(100 * seconds)):
        rotor = min(1.0, 0.01 * k) * 50.0 * np.sin(2.0 * np.pi * 2.0 * 0.01 * k)
        plant.step(np.column_stack([np.full(len(rudder), rotor), rudder]))
        rows.append(plant.motion)
    return np.array(rows)


@pytest.mark.slow
def test_the_second_plant_swims_and_turns_as_the_rudder_says(basin) -> None:
    motion = drive(basin(3), np.array([0.0, 0.5, -0.5]), 6.0)[-200:].mean(axis=0)
    assert 0.05 < motion[0, 3] < 0.3 and abs(motion[0, 5]) < 0.02
    assert motion[1, 5] > 0.05 and motion[2, 5] < -0.05  # a positive rudder steers left


def test_the_second_plants_wind_carries_the_fish(basin) -> None:
    plant = basin(1, wind={"x": 0.05, "y": 0.0})
    plant.reset(np.zeros((1, 3)))
    for _ in range(300):
        felt = plant.step(np.zeros((1, 2)))
    assert 1e-4 < plant.pose[0, 0] < 0.15 and abs(plant.pose[0, 1]) < 1e-6
    assert abs(felt.left[0]) < 1e-6
