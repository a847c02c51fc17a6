"""The blind study: labels that cannot be changed afterwards, runs that go on, the oracle beside the tool."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from prove_samples import diagnosis, small

from fish_report.command_words import words_after
from fish_report.json_file import write_json
from fish_report.robofish import main
from fish_study import oracle_scores as judging
from fish_study import runner, tool_version
from fish_study.build import make_readings
from fish_study.commitment import Sealed, broken_seals, seal_label
from fish_study.competitors import Rivals
from fish_study.localisation import (
    dof_overlap,
    overlap,
    stated_range,
    stated_times,
    true_push,
)
from fish_study.oracle import (
    Looked,
    Sight,
    as_experiment,
    detects,
    look,
    with_truth,
)
from fish_study.oracle_scores import judge, judged_table, rivals_table
from fish_study.runner import Job, run_study, run_world
from fish_study.scenario import NoWorld, World
from fish_study.score import score_world
from fish_study.study import Study, StudyError, read_json
from fish_study.tables import Share
from fish_study.tool_version import tool_digest
from fish_sysid.diagnosis.effect_wrench import (
    acting,
    effect_wrench,
    f1,
    regimes,
)
from fish_sysid.diagnosis.latent_force import MissingForce
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate

TOOL = (sys.executable, str(Path(__file__).with_name("fake_tool.py")))


def test_labels_cannot_be_changed_after_the_seal() -> None:
    sealed = {
        "a": seal_label({"effects": {"current": {"x": 0.1}}}),
        "b": seal_label({"effects": {}}),
    }
    seals = {name: s.seal for name, s in sealed.items()}
    assert broken_seals(seals, sealed) == []
    assert seal_label({"effects": {}}).seal != sealed["b"].seal  # the salt hides equal labels
    changed = {**sealed, "a": Sealed(sealed["a"].salt, {"effects": {"current": {"x": 0.2}}})}
    assert broken_seals(seals, changed) == ["a"]
    assert broken_seals(seals, {"a": sealed["a"]}) == ["b"]


def three_worlds() -> list[World]:
    kinds = (("single", 0), ("null", 0), ("outside", 4))
    return [small(group, number, seed=k) for k, (group, number) in enumerate(kinds)]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A study of three worlds that was stopped at its last one and went on; on the second the tool fails."""
    study = Study.create(
        tmp_path_factory.mktemp("ran") / "study",
        three_worlds(),
        {"seed": 1, "began": "today", "command": "test", "tool": tool_digest()},
    )
    seals, done = read_json(study.folder / "seals.json"), []
    left = study.place("world_0000") / "recordings" / "half"  # of a run that was killed
    left.mkdir(parents=True)
    with pytest.raises(StudyError, match="world_0002: the tool was stopped"):
        run_study(study, 1, done.append, TOOL)
    stopped = SimpleNamespace(done=list(done), left=study.open_worlds)
    run_study(study, 1, done.append, TOOL)
    return SimpleNamespace(study=study, seals=seals, stopped=stopped, done=done)


@pytest.fixture
def study(ran: SimpleNamespace, tmp_path: Path) -> Study:
    """A copy of that study, nothing opened yet."""
    shutil.copytree(ran.study.folder, tmp_path / "study")
    return Study(tmp_path / "study")


def test_labels_stay_sealed_until_every_world_has_a_result(tmp_path: Path) -> None:
    study = Study.create(tmp_path / "study", three_worlds(), {"seed": 1})
    assert (study.folder / "sealed.json").stat().st_mode & 0o077 == 0
    with pytest.raises(StudyError, match="3 worlds have no result"):
        study.reveal()
    with pytest.raises(StudyError, match="already"):
        Study.create(tmp_path / "study", three_worlds(), {})
    assert not (study.folder / "labels.json").exists()


def test_a_study_goes_on_where_it_was_stopped(ran: SimpleNamespace) -> None:
    assert ran.stopped.done == ["world_0000", "world_0001"]
    assert ran.stopped.left == ["world_0002"]
    assert ran.done == ["world_0000", "world_0001", "world_0002"]
    run_study(ran.study, 1, lambda name: pytest.fail(f"{name} ran twice"), TOOL)
    assert read_json(ran.study.folder / "seals.json") == ran.seals


def test_the_tool_is_given_the_recordings_and_no_more(ran: SimpleNamespace) -> None:
    told = ran.study.results["world_0000"]["diagnosis"]["seen"]
    assert told["trials"] == ["trial_00", "trial_01", "trial_02"]
    place = ran.study.place("world_0000").resolve()
    assert told["arguments"] == [str(place / "recordings"), "--out", str(place / "tool")]
    assert not (place / "recordings").exists()


def test_an_opened_study_has_the_labels_that_were_sealed(study: Study) -> None:
    opened = study.reveal()
    assert list(opened.values()) == three_worlds()
    assert {
        n: World.of(s["label"]) for n, s in read_json(study.folder / "labels.json").items()
    } == opened
    scores = [score_world(world, study.results[name]) for name, world in opened.items()]
    assert [s.verdict for s in scores] == ["no_mismatch", "failed", "no_mismatch"]
    assert "exit status 3: cannot" in scores[1].error
    seals = study.folder / "seals.json"
    seals.write_text(seals.read_text().replace(read_json(seals)["world_0001"], "0"))
    with pytest.raises(StudyError, match="not what was sealed: world_0001"):
        study.reveal()


def test_finished_studies_of_one_version_are_pooled(study: Study, tmp_path: Path) -> None:
    about = {**study.about, "seed": 2, "began": "later", "command": "again"}
    other = Study.create(
        tmp_path / "other", [replace(w, seed=w.seed + 3) for w in three_worlds()], about
    )
    shutil.copytree(study.folder / "worlds", other.folder / "worlds")
    result = other.place("world_0002") / "result.json"
    kept = result.read_bytes()
    result.unlink()
    pool = [
        "prove",
        "--pool",
        str(study.folder),
        str(other.folder),
        "--out",
        str(tmp_path / "pooled"),
    ]
    assert main(pool) == 1  # nothing is said before every label may be opened
    result.write_bytes(kept)
    assert main(pool) == 0
    page = (tmp_path / "pooled" / "report.html").read_text()
    assert "6 worlds, 4 of them with something hidden; seed 1, today; seed 2, later" in page
    assert "exit status 3: cannot" in page
    assert "Asked and measured" in page
    newer = Study.create(tmp_path / "newer", three_worlds(), {"tool": "0123456789abcdef"})
    assert main([*pool[:2], str(study.folder), str(newer.folder), *pool[4:]]) == 1
    with pytest.raises(StudyError, match="got version 0123456789abcdef of the tool, expected"):
        newer.check_tool(tool_digest())


def test_no_world_counts_twice(
    study: Study, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def pool(*folders: Path) -> str:
        assert main(["prove", "--pool", *map(str, folders), "--out", str(tmp_path / "pooled")]) == 1
        return " ".join(capsys.readouterr().err.split())

    again = f"twice, as {study.folder}/worlds/world_0000 and {study.folder}/worlds/world_0000; expected every world once"
    assert again in pool(study.folder, study.folder)
    repeated = Study.create(
        tmp_path / "repeated", three_worlds()[2:], study.about
    )  # another salt, the same world
    shutil.copytree(study.place("world_0002"), repeated.place("world_0000"))
    assert "got the world of seed 2 twice" in pool(study.folder, repeated.folder)


def retold(file: Path, tool: str | None) -> None:
    """The same file, made by another version of the tool (None: of a time that told none)."""
    content = {k: v for k, v in read_json(file).items() if k != "tool"}
    write_json(file, content if tool is None else {**content, "tool": tool})


def test_answers_of_two_versions_make_no_study(study: Study) -> None:
    own = tool_digest()
    assert {result["tool"] for result in study.results.values()} == {own}
    files = [study.place(name) / "result.json" for name in study.worlds]
    retold(files[0], None)  # of before the file told it
    assert len(study.results) == 3
    retold(files[2], "0123456789abcdef")
    with pytest.raises(
        StudyError,
        match=f"got result.json in world_0002 of 0123456789abcdef, expected version {own}",
    ):
        study.results  # noqa: B018


def test_a_tool_that_changes_while_a_study_runs_stops_it(tmp_path: Path) -> None:
    study = Study.create(
        tmp_path / "study", [small("null")], {"seed": 1, "tool": "0123456789abcdef"}
    )
    with pytest.raises(
        StudyError, match=r"world_0000: got version .* of the tool, expected 0123456789abcdef"
    ):
        run_study(study, 1, lambda _: None, TOOL)
    assert study.open_worlds == ["world_0000"]


def test_a_study_is_judged_by_its_own_tool(study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging, "spread", lambda work, tasks, jobs, cluster: map(work, tasks))
    monkeypatch.setattr(judging, "judge", lambda world, diagnosis: {"sight": None})
    scores = [score_world(w, study.results[n]) for n, w in study.reveal().items()]

    def judge_it() -> None:
        judging.judge_studies([study], scores, 1, lambda _: None)

    judge_it()
    files = [study.place(name) / "judged.json" for name in study.worlds]
    assert {read_json(file)["tool"] for file in files} == {tool_digest()}
    retold(files[0], None)
    judge_it()
    retold(files[1], "0123456789abcdef")
    with pytest.raises(
        StudyError, match=r"got judged.json in world_0001 of 0123456789abcdef, expected version"
    ):
        judge_it()
    for (
        name
    ) in study.worlds:  # a study of another tool: what is judged is read, nothing is judged anew
        retold(study.place(name) / "result.json", "0123456789abcdef")
        retold(study.place(name) / "judged.json", "0123456789abcdef")
    retold(study.folder / "study.json", "0123456789abcdef")
    judge_it()
    files[2].unlink()
    with pytest.raises(
        StudyError,
        match=r"1 worlds are not judged yet, .* check out the version that the study ran with",
    ):
        judge_it()
    assert not files[2].exists()


@pytest.fixture
def run_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any]]:
    """The result of a world whose recordings are an empty folder, and whose tool is a line of Python."""
    monkeypatch.setattr(runner, "make_world", lambda world, folder: folder.mkdir())

    def result(tool: str, **changes: Any) -> dict[str, Any]:
        command = (sys.executable, "-c", f"import os, pathlib, signal, sys, time; {tool}")
        run_world(Job("a", small("null"), tmp_path, command, **changes))
        return read_json(tmp_path / "result.json")

    return result


def test_a_tool_that_does_not_end_is_a_result(run_with, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "LONGEST", 0.2)
    result = run_with("time.sleep(60)")
    assert result["diagnosis"] is None
    assert result["error"] == "no answer within 0.2 s"
    assert 0.2 <= result["seconds"] < 30.0


def test_of_a_tool_that_fails_the_last_words_are_kept(run_with) -> None:
    result = run_with("sys.exit('first ' + 'x' * 3000 + ' last')")
    assert result["error"].startswith("exit status 1: x")
    assert result["error"].endswith(" last\n")


def test_a_tool_that_somebody_stopped_is_no_result(run_with, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="a: the tool was stopped"):
        run_with("os.kill(os.getpid(), signal.SIGTERM)")
    assert not (tmp_path / "result.json").exists()


@pytest.mark.parametrize("keep", [True, False])
def test_recordings_are_kept_if_asked_and_the_tool_gets_its_threads(
    run_with, tmp_path: Path, keep: bool
) -> None:
    write = "p = pathlib.Path(sys.argv[-1]); p.mkdir(); (p / 'diagnosis.json').write_text(os.environ['OMP_NUM_THREADS'])"
    assert run_with(write, keep=keep, threads=3)["diagnosis"] == 3
    assert (tmp_path / "recordings").exists() is keep


def test_a_study_that_is_killed_leaves_no_tool_behind(tmp_path: Path) -> None:
    Study.create(tmp_path / "study", [small("null")], {"seed": 1})
    tool = "import os, sys, time, pathlib as p; (p.Path(sys.argv[1]) / 'pid').write_text(str(os.getpid())); time.sleep(600)"
    study = f"""from pathlib import Path
from fish_study.runner import Job, run_study, run_world
from fish_study.study import Study
run_study(Study(Path({str(tmp_path / "study")!r})), 1, print, ({sys.executable!r}, "-c", {tool!r}))
"""
    with subprocess.Popen([sys.executable, "-c", study]) as run:
        note = tmp_path / "study/worlds/world_0000/recordings/pid"
        assert comes_true(lambda: note.exists() and note.read_text())
        run.kill()
    assert comes_true(lambda: not Path(f"/proc/{note.read_text()}").exists())


def test_the_tool_s_version_is_that_of_its_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = tool_digest()
    assert len(whole) == 16
    assert whole == tool_digest()
    monkeypatch.setattr(tool_version, "PARTS", tool_version.PARTS[:-1])
    assert tool_digest() != whole


def test_the_tool_s_version_leaves_out_what_no_answer_depends_on(tmp_path: Path) -> None:
    (tmp_path / "nodes").mkdir()
    (tmp_path / "methods").mkdir()
    for file in ("nodes/pacer.py", "methods/heun.py", "step.py", "notes.txt"):
        (tmp_path / file).write_text("x = 1\n")
    assert sorted(name for name, _ in tool_version._texts(tmp_path)) == [
        "methods/heun.py",
        "step.py",
    ]


def test_a_tool_is_the_same_after_a_word_about_it_and_another_after_a_number():
    before = tool_version.code('"""Steps."""\n\nSTEP = 0.1  # s\n\n\ndef f():\n    """Twice."""\n')
    assert tool_version.code('STEP = (\n    0.1\n)\ndef f():\n    """Thrice."""\n') == before
    assert tool_version.code("STEP = 0.2\ndef f(): pass\n") != before


def comes_true(condition: Callable[[], object], patience: float = 60.0) -> bool:
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(condition())


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
    world = World("single", 3, effects, count=3, duration=10.0)
    experiment = as_experiment(make_readings(world), True)
    push = true_push(world, experiment)
    assert push is not None
    acts = acting(push, np.array(Noise().wrench))
    near = push.covariates["wall_distance"]
    assert 0.02 < acts.mean() < 0.8
    assert near[acts].mean() < near[~acts].mean()
    assert stated_range(regimes(push, np.array(Noise().wrench)), push.covariates)[acts].mean() > 0.5
    assert true_push(World("single", 1, {"current": {"x": 0.03}}), experiment) is None


def test_the_wrench_of_a_drag_is_its_equation() -> None:
    """-k |u| u on the head, from the accelerations with and without it."""
    world = World(
        "single",
        3,
        {"quadratic_drag": {"surge": 0.5, "sway": 0.0, "yaw": 0.0}},
        count=2,
        duration=4.0,
    )
    experiment = as_experiment(make_readings(world), True)
    hypothesis, theta = with_truth(world, world.names)
    push = effect_wrench(
        evaluate(hypothesis, theta, experiment, Noise()), "quadratic_drag", experiment
    )
    u = push.covariates["surge_speed"]
    np.testing.assert_allclose(push.wrench[..., 0], -0.5 * np.abs(u) * u, atol=1e-6)
    np.testing.assert_allclose(push.wrench[..., 1:], 0.0, atol=1e-6)


def test_the_wrench_of_a_flow_is_that_of_all_of_it() -> None:
    """The mean of a flow that differs hardly from place to place pushes as the uniform current does."""
    push = {}
    for name, values in (
        ("current", {"x": 0.05}),
        ("nonuniform_current", {"mean_x": 0.05, "shear_x": 1e-4}),
    ):
        world = World("single", 3, {name: values}, count=2, duration=2.0)
        experiment = as_experiment(make_readings(world), True)
        hypothesis, theta = with_truth(world, world.names)
        push[name] = effect_wrench(
            evaluate(hypothesis, theta, experiment, Noise()), name, experiment
        ).wrench
    size = np.abs(push["current"]).max()
    np.testing.assert_allclose(push["nonuniform_current"], push["current"], atol=0.05 * size)


def test_the_oracle_and_the_rivals_by_hand() -> None:
    def sight(gain: float) -> Sight:
        return Sight(
            gain, 1, [[0.02] * 3, [0.04] * 3, [0.1] * 3], [[0.01] * 3, [0.02] * 3, [0.05] * 3]
        )

    assert detects(sight(3.0), [])
    assert not detects(sight(2.6), [])
    assert not detects(sight(3.0), [sight(100.0)] * 25)  # but not where nothing looks like that too
    world = World("single", 1, {"current": {"x": 0.03}})
    answer = diagnosis(("current", "physics", 0.9))
    answer["diagnosis"]["fit"]["with_effects"]["rms"] = {"2 s": {"position_m": 0.022}}
    right, null = (
        score_world(world, answer),
        score_world(World("null", 2), diagnosis(verdict="no_mismatch")),
    )
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
    assert rows[0][1].startswith("1/1")
    assert rows[1][1].startswith("0/1")
    assert rows[1][2].startswith("0/1")


def test_the_judge_sees_a_hidden_current_as_the_oracle_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its fit from the true values predicts better, with the noise of the world; a current acts everywhere, so no times."""
    seen: list[Looked] = []
    monkeypatch.setattr(judging, "look", lambda *given: seen.append(look(*given)) or seen[0])
    monkeypatch.setattr(judging, "compete", lambda *_: Rivals("current", 0.5, 0.6))
    world = small("single", 1, encoder=True, noise=2.0)
    assert world.names == ("current",)
    content = judge(world, {"fit": {"held_out_trials": ["trial_02"]}, "effects": []})
    sight = Sight.read(content["sight"])
    assert detects(sight, [])
    assert sight.gain > 100.0
    assert sight.parameters == 2
    assert sight.rms_true[1][0] < 0.7 * sight.rms_nominal[1][0]
    assert {k: content[k] for k in ("dof", "overlap", "f1")} == {
        "dof": None,
        "overlap": None,
        "f1": None,
    }
    assert content["rivals"] == {"sindy": "current", "sindy_r2": 0.5, "neural_r2": 0.6}
    (looked,) = seen
    assert looked.training.names == ("trial_00", "trial_01")
    assert looked.held_out.names == ("trial_02",)
    assert looked.true.noise.gyro == pytest.approx(2.0 * Noise().gyro, rel=0.1)
    for key, true in world.effects["current"].items():
        name = f"current.{key}"
        assert looked.true.values[name] == pytest.approx(
            true, abs=4.0 * looked.true.standard_errors[name]
        )


def test_a_world_without_an_answer_is_judged_and_counts_as_not_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The oracle sees its current; neither the tool nor a table of it may lose the world."""
    seen: list[Looked] = []
    monkeypatch.setattr(judging, "look", lambda *given: seen.append(look(*given)) or seen[-1])
    monkeypatch.setattr(judging, "compete", lambda *_: Rivals("current", 0.5, 0.6))
    monkeypatch.setattr(judging, "spread", lambda work, tasks, jobs, cluster: map(work, tasks))
    kinds = (("single", 1), ("null", 1), ("null", 0))
    worlds = [small(group, number, encoder=True, seed=k) for k, (group, number) in enumerate(kinds)]
    study = Study.create(tmp_path / "study", worlds, {"seed": 1, "tool": tool_digest()})
    for name in study.worlds:
        study.place(name).mkdir(parents=True)
        write_json(
            study.place(name) / "result.json",
            {"seconds": 1.0, "diagnosis": None, "error": "exit status 3"},
        )
    scores = [score_world(w, study.results[n]) for n, w in study.reveal().items()]
    oracle, (against, rivals) = judging.judge_studies([study], scores, 1, lambda _: None)
    assert worlds[1].links > 3
    assert worlds[2].links == 3
    assert len(seen) == 2
    assert {s.held_out.names for s in seen} == {("trial_02",)}
    assert oracle == {worlds[0].seed: True}
    assert against.rows[0][2] == "0% of 1"
    assert [row[1].split(" =")[0] for row in rivals.rows[:2]] == ["0/1", "1/1"]
    assert rivals.rows[0][2] == "–"
    assert rivals.rows[1][2].startswith("1/1")


def test_what_could_not_be_made_is_judged_as_unseen(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(world: World) -> None:
        raise NoWorld("a fish that fits nowhere")

    monkeypatch.setattr(judging, "make_readings", lost)
    assert judge(small("single", 1), None)["sight"] is None


def test_the_judge_sees_what_has_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judging, "compete", lambda *_: Rivals(None, 0.0, 0.0))
    world = small("outside", 4, encoder=True)
    assert world.names == ("compass",)
    sight = Sight.read(
        judge(world, {"fit": {"held_out_trials": ["trial_02"]}, "effects": []})["sight"]
    )
    assert detects(sight, [])
    assert sight.parameters == 2
    assert np.isfinite(sight.rms_true[1][0])


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


def test_a_study_goes_on_with_the_same_command_and_with_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(study: Study, *_: object, **__: object) -> None:
        for name in study.open_worlds:
            study.place(name).mkdir(parents=True)
            write_json(
                study.place(name) / "result.json",
                {"seconds": 1.0, **diagnosis(verdict="no_mismatch")},
            )

    monkeypatch.setattr(runner, "run_study", run)
    out = tmp_path / "study"
    command = [
        "prove",
        "--worlds",
        "3",
        "--trials",
        "4",
        "--groups",
        "null",
        "--seed",
        "5",
        "--out",
        str(out),
    ]
    assert main(command) == 0
    about = read_json(out / "study.json")
    assert {
        key: about[key] for key in ("worlds", "trials", "groups", "duration", "seed", "drawn")
    } == {
        "worlds": 3,
        "trials": 4,
        "groups": ["null"],
        "duration": 20.0,
        "seed": 5,
        "drawn": False,
    }
    assert "Seed 5 was given" in (out / "report.html").read_text()
    assert main(command) == 0
    assert main(["prove", "--out", str(out)]) == 0
    capsys.readouterr()
    for option, said in (
        (["--worlds", "300"], "got worlds 300, expected 3:"),
        (["--trials", "12", "--seed", "7"], "got trials 12, expected 4; seed 7, expected 5:"),
        (["--groups", "null", "single"], "got groups ['null', 'single'], expected ['null']:"),
        (["--duration", "12"], "got duration 12.0, expected 20.0:"),
    ):
        assert main(["prove", *option, "--out", str(out)]) == 1
        assert said in " ".join(capsys.readouterr().err.split())
    assert (
        main(["prove", "--worlds", "2", "--groups", "null", "--out", str(tmp_path / "drawn")]) == 0
    )
    assert read_json(tmp_path / "drawn" / "study.json")["drawn"] is True


@pytest.mark.parametrize(
    "argv", [["robofish", "prove", "--seed", "7"], ["lib/fish_train/prove", "--seed", "7"]]
)
def test_the_command_is_recorded_whichever_way_it_was_called(argv) -> None:
    assert words_after("prove", argv) == ["--seed", "7"]
