# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A study on disk, its runs, and the verb prove.

Labels cannot be changed afterwards, scenarios count once, one version of the tool: that of the code that its answers depend on.
Running the tool on scenarios: what it is given, what is kept, what happens when it fails or is stopped. A study is gone on with
as it was begun, and read from folders and archives.
"""

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

import pytest
from prove_samples import diagnosis, small, three_scenarios

from fish_report.files import write_json
from fish_report.robofish import main, words_after
from fish_study import runner, tool_version
from fish_study.ablation import (
    COMPLETE,
    ablation_studies,
    ablation_table,
    search_stages,
    take_same_answers,
)
from fish_study.new_study import Asked, begin_or_go_on
from fish_study.oracle_scores import score_studies
from fish_study.runner import Job, run_scenario, run_study
from fish_study.scenario import Scenario
from fish_study.score import score_scenario
from fish_study.study import (
    Opening,
    Study,
    StudyError,
    broken_commitments,
    commit,
    pack_studies,
    read_json,
)
from fish_study.tool_version import tool_digest

TOOL = (sys.executable, str(Path(__file__).with_name("fake_tool.py")))
NULLS = Asked(3, ["null"], 4, 20.0, 5, frozenset({"scenarios", "groups", "trials", "seed"}))


def test_labels_cannot_be_changed_after_the_commitment() -> None:
    openings = {
        "a": commit({"effects": {"current": {"x": 0.1}}}),
        "b": commit({"effects": {}}),
    }
    commitments = {name: opening.commitment for name, opening in openings.items()}
    assert broken_commitments(commitments, openings) == []
    assert (
        commit({"effects": {}}).commitment != openings["b"].commitment
    )  # the salt hides equal labels
    changed = {**openings, "a": Opening(openings["a"].salt, {"effects": {"current": {"x": 0.2}}})}
    assert broken_commitments(commitments, changed) == ["a"]
    assert broken_commitments(commitments, {"a": openings["a"]}) == ["b"]


def test_labels_stay_sealed_until_every_scenario_has_a_result(tmp_path: Path) -> None:
    study = Study.create(tmp_path / "study", three_scenarios(), {"seed": 1})
    assert (study.folder / "openings.json").stat().st_mode & 0o077 == 0
    with pytest.raises(StudyError, match="3 scenarios have no result"):
        study.open_labels()
    with pytest.raises(StudyError, match="already"):
        Study.create(tmp_path / "study", three_scenarios(), {})
    assert not (study.folder / "labels.json").exists()


def test_an_opened_study_has_the_labels_committed_to(study: Study) -> None:
    opened = study.open_labels()
    assert list(opened.values()) == three_scenarios()
    assert {
        n: Scenario.of(s["label"]) for n, s in read_json(study.folder / "labels.json").items()
    } == opened
    scores = [score_scenario(scenario, study.results[name]) for name, scenario in opened.items()]
    assert [s.verdict for s in scores] == ["no_mismatch", "failed", "no_mismatch"]
    assert "exit status 3: cannot" in scores[1].error
    commitments = study.folder / "commitments.json"
    commitments.write_text(
        commitments.read_text().replace(read_json(commitments)["scenario_0001"], "0")
    )
    with pytest.raises(StudyError, match="not those committed to: scenario_0001"):
        study.open_labels()


def test_finished_studies_of_one_version_are_pooled(study: Study, tmp_path: Path) -> None:
    about = {**study.about, "seed": 2, "began": "later", "command": "again"}
    other = Study.create(
        tmp_path / "other", [replace(w, seed=w.seed + 3) for w in three_scenarios()], about
    )
    shutil.copytree(study.folder / "scenarios", other.folder / "scenarios")
    result = other.folder_of("scenario_0002") / "result.json"
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
    assert "6 scenarios, 4 of them with something hidden; seed 1, today; seed 2, later" in page
    assert "exit status 3: cannot" in page
    assert "Asked and measured" in page
    newer = Study.create(tmp_path / "newer", three_scenarios(), {"tool": "0123456789abcdef"})
    assert main([*pool[:2], str(study.folder), str(newer.folder), *pool[4:]]) == 1
    with pytest.raises(StudyError, match="got version 0123456789abcdef of the tool, expected"):
        newer.check_tool(tool_digest())


def test_no_scenario_counts_twice(
    study: Study, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def pool(*folders: Path) -> str:
        assert main(["prove", "--pool", *map(str, folders), "--out", str(tmp_path / "pooled")]) == 1
        return " ".join(capsys.readouterr().err.split())

    first = study.folder_of("scenario_0000")
    again = f"twice, as {first} and {first}; expected every scenario once"
    assert again in pool(study.folder, study.folder)
    repeated = Study.create(
        tmp_path / "repeated", three_scenarios()[2:], study.about
    )  # another salt, the same scenario
    shutil.copytree(study.folder_of("scenario_0002"), repeated.folder_of("scenario_0000"))
    assert "got the scenario of seed 2 twice" in pool(study.folder, repeated.folder)


def made_by(file: Path, tool: str | None) -> None:
    """The same file, made by another version of the tool (None: it does not say which)."""
    content = {k: v for k, v in read_json(file).items() if k != "tool"}
    write_json(file, content if tool is None else {**content, "tool": tool})


def test_answers_of_two_versions_make_no_study(study: Study) -> None:
    own = tool_digest()
    assert {result["tool"] for result in study.results.values()} == {own}
    files = [study.folder_of(name) / "result.json" for name in study.scenarios]
    made_by(files[0], None)
    assert len(study.results) == 3
    made_by(files[2], "0123456789abcdef")
    with pytest.raises(
        StudyError,
        match=f"got result.json in scenario_0002 of 0123456789abcdef, expected version {own}",
    ):
        study.results  # noqa: B018


def test_a_study_is_scored_by_its_own_tool(study: Study) -> None:
    """Scores that are there are read; missing ones are made by the study's own version alone."""
    study.open_labels()
    files = [study.folder_of(name) / "oracle.json" for name in study.scenarios]

    def score() -> None:
        score_studies([study], 1, lambda _: None)

    for file in files:
        write_json(file, {"fits": None, "tool": tool_digest()})
    made_by(files[0], None)
    score()
    made_by(files[1], "0123456789abcdef")
    with pytest.raises(
        StudyError, match=r"got oracle.json in scenario_0001 of 0123456789abcdef, expected version"
    ):
        score()
    for name in study.scenarios:
        made_by(study.folder_of(name) / "result.json", "0123456789abcdef")
        made_by(study.folder_of(name) / "oracle.json", "0123456789abcdef")
    made_by(study.folder / "study.json", "0123456789abcdef")
    score()
    files[2].unlink()
    with pytest.raises(
        StudyError,
        match=r"1 scenarios have no scores .* check out the version that the study ran with",
    ):
        score()
    assert not files[2].exists()


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


def test_a_study_goes_on_where_it_was_stopped(ran: SimpleNamespace) -> None:
    assert ran.stopped.done == ["scenario_0000", "scenario_0001"]
    assert ran.stopped.left == ["scenario_0002"]
    assert ran.done == ["scenario_0000", "scenario_0001", "scenario_0002"]
    run_study(ran.study, 1, lambda name: pytest.fail(f"{name} ran twice"), TOOL)
    assert read_json(ran.study.folder / "commitments.json") == ran.commitments


def test_the_tool_is_given_the_recordings_and_no_more(ran: SimpleNamespace) -> None:
    seen = ran.study.results["scenario_0000"]["diagnosis"]["seen"]
    assert seen["trials"] == ["trial_00", "trial_01", "trial_02"]
    place = ran.study.folder_of("scenario_0000").resolve()
    assert seen["arguments"] == [str(place / "recordings"), "--out", str(place / "tool")]
    assert not (place / "recordings").exists()


def test_a_tool_that_changes_while_a_study_runs_stops_it(tmp_path: Path) -> None:
    study = Study.create(
        tmp_path / "study", [small("null")], {"seed": 1, "tool": "0123456789abcdef"}
    )
    with pytest.raises(
        StudyError, match=r"scenario_0000: got version .* of the tool, expected 0123456789abcdef"
    ):
        run_study(study, 1, lambda _: None, TOOL)
    assert study.pending == ["scenario_0000"]


@pytest.fixture
def run_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any]]:
    """The result of a scenario whose recordings are an empty folder, and whose tool is a line of Python."""
    monkeypatch.setattr(runner, "make_recordings", lambda scenario, folder: folder.mkdir())

    def result(tool: str, **changes: Any) -> dict[str, Any]:
        command = (sys.executable, "-c", f"import os, pathlib, signal, sys, time; {tool}")
        run_scenario(Job("a", small("null"), tmp_path, command, **changes))
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


@pytest.mark.timeout(900)
def test_a_study_that_is_killed_leaves_no_tool_behind(tmp_path: Path) -> None:
    Study.create(tmp_path / "study", [small("null")], {"seed": 1})
    tool = "import os, sys, time, pathlib as p; (p.Path(sys.argv[1]) / 'pid').write_text(str(os.getpid())); time.sleep(600)"
    study = f"""from pathlib import Path
from fish_study.runner import Job, run_study, run_scenario
from fish_study.study import Study
run_study(Study(Path({str(tmp_path / "study")!r})), 1, print, ({sys.executable!r}, "-c", {tool!r}))
"""
    with subprocess.Popen([sys.executable, "-c", study]) as run:
        note = tmp_path / "study/scenarios/scenario_0000/recordings/pid"
        try:
            assert comes_true(lambda: note.exists() and note.read_text())
        finally:
            run.kill()
    assert comes_true(lambda: not Path(f"/proc/{note.read_text()}").exists())


def comes_true(condition: Callable[[], object], patience: float = 400.0) -> bool:
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(condition())


def answer_all(study: Study, verdict: str = "no_mismatch", seconds: float = 1.0) -> Study:
    """The same answer to every scenario."""
    for name in study.scenarios:
        study.folder_of(name).mkdir(parents=True, exist_ok=True)
        result = {**diagnosis(verdict=verdict), "seconds": seconds}
        write_json(study.folder_of(name) / "result.json", result)
    return study


def test_a_study_goes_on_with_the_same_command_and_with_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "study"
    about = answer_all(begin_or_go_on(out, NULLS)).about
    asked = {k: about[k] for k in ("scenarios", "trials", "groups", "duration", "seed", "drawn")}
    assert asked == {
        "scenarios": 3,
        "trials": 4,
        "groups": ["null"],
        "duration": 20.0,
        "seed": 5,
        "drawn": False,
    }
    command = "prove --scenarios 3 --trials 4 --groups null --seed 5 --out".split()
    assert main([*command, str(out)]) == 0
    assert "Seed 5 was given" in (out / "report.html").read_text()
    assert main(["prove", "--out", str(out)]) == 0
    capsys.readouterr()
    for option, message in (
        ("--scenarios 300", "got scenarios 300, expected 3:"),
        ("--trials 12 --seed 7", "got trials 12, expected 4; seed 7, expected 5:"),
        ("--groups null single", "got groups ['null', 'single'], expected ['null']:"),
        ("--duration 12", "got duration 12.0, expected 20.0:"),
    ):
        assert main(["prove", *option.split(), "--out", str(out)]) == 1
        assert message in " ".join(capsys.readouterr().err.split())
    drawn = begin_or_go_on(tmp_path / "drawn", Asked(2, ["null"], 4, 20.0, None))
    assert drawn.about["drawn"] is True


def test_an_archive_of_studies_prints_the_tables_of_its_folders(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = [
        answer_all(begin_or_go_on(tmp_path / name, Asked(2, groups, 4, 20.0, seed)))
        for name, groups, seed in (("a", ["null"], 1), ("b", ["single"], 2))
    ]
    archive = tmp_path / "both.tar.xz"
    pack_studies(parts, archive)
    printed = []
    for given in (archive,), tuple(part.folder for part in parts):
        assert main(["prove", "--pool", *map(str, given), "--out", str(tmp_path / "pooled")]) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]
    assert "1/2" in printed[0] or "0/2" in printed[0]
    again = tmp_path / "again.tar.xz"
    pack_studies(parts, again)
    assert again.read_bytes() == archive.read_bytes()


def test_what_is_no_archive_of_studies_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "study.tar.xz"
    file.write_bytes(b"no archive")
    for path, message in (
        (file, "cannot be read as studies"),
        (tmp_path / "none.tar.xz", "cannot be read as studies"),
    ):
        assert main(["prove", "--pool", str(path), "--out", str(tmp_path / "out")]) == 1
        assert f"{path}: {message}" in " ".join(capsys.readouterr().err.split())
    pack_studies([], file)
    assert main(["prove", "--pool", str(file), "--out", str(tmp_path / "out")]) == 1
    assert "has no folder with a study.json" in " ".join(capsys.readouterr().err.split())


def test_an_ablation_diagnoses_the_same_scenarios_without_each_stage(tmp_path: Path) -> None:
    asked = Asked(4, ["null", "outside"], 4, 20.0, None)
    studies = ablation_studies(tmp_path, asked, ["first", "second"])
    assert list(studies) == [COMPLETE, "first", "second"]
    drawn = [list(study.scenarios.values()) for study in studies.values()]
    assert drawn[0] == drawn[1] == drawn[2]
    assert [study.about["without"] for study in studies.values()] == ["", "first", "second"]
    again = ablation_studies(tmp_path, asked, ["first"])
    assert again["first"].folder == studies["first"].folder
    with pytest.raises(StudyError, match="begun with other arguments"):
        ablation_studies(tmp_path, Asked(5, ["null"], 4, 20.0, None, frozenset({"scenarios"})), [])
    answer_all(studies[COMPLETE])
    answer_all(studies["first"], "unexplained", 9.0)
    table = ablation_table({n: studies[n] for n in (COMPLETE, "first")})
    nulls = sum(s.group == "null" for s in drawn[0])
    others = 4 - nulls
    assert table.rows == [
        ["nothing", "–", "–", f"0/{nulls}", "–", f"0/{others}", "–", "–"],
        ["first", "–", "–", f"{nulls}/{nulls}", "–", f"{others}/{others}", "4/4", "1, 9"],
    ]


def test_what_a_search_does_not_come_to_needs_no_second_run(tmp_path: Path) -> None:
    studies = ablation_studies(tmp_path, Asked(3, ["null"], 4, 20.0, None), ["first"])
    complete, without = studies[COMPLETE], studies["first"]
    answer_all(complete)
    names = list(complete.results)
    for name, stages in zip(names, (["second"], ["first", "second"], None), strict=True):
        file = complete.folder_of(name) / "result.json"
        result = read_json(file)
        if stages is not None:
            result["diagnosis"]["stages"] = stages
        write_json(file, result)
    assert take_same_answers(complete, without, "first") == names[:1]
    assert without.results[names[0]] == complete.results[names[0]]
    assert without.pending == names[1:]


def test_a_stage_that_the_diagnosis_does_not_have_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["prove", "--without", "nonsense", "--out", str(tmp_path / "out")]) == 1
    message = " ".join(capsys.readouterr().err.split())
    assert "--without: got nonsense; expected stages of the diagnosis: " in message
    assert all(stage in message for stage in search_stages())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "argv", [["robofish", "prove", "--seed", "7"], ["lib/fish_study/prove", "--seed", "7"]]
)
def test_the_command_is_recorded_whichever_way_it_was_called(argv: list[str]) -> None:
    assert words_after("prove", argv) == ["--seed", "7"]
