# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A study on disk: labels that cannot be changed afterwards, scenarios that count once, one version of the tool."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from prove_samples import three_scenarios

from fish_report.json_file import write_json
from fish_report.robofish import main
from fish_study.commitment import Opening, broken_commitments, commit
from fish_study.oracle_scores import score_studies
from fish_study.scenario import Scenario
from fish_study.score import score_scenario
from fish_study.study import Study, StudyError, read_json
from fish_study.tool_version import tool_digest


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
