# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The verb prove: a study is gone on with as it was begun, and read from folders and archives."""

from __future__ import annotations

from pathlib import Path

import pytest
from prove_samples import diagnosis

from fish_report.command_words import words_after
from fish_report.json_file import write_json
from fish_report.robofish import main
from fish_study.ablation import (
    COMPLETE,
    ablation_studies,
    ablation_table,
    search_stages,
    take_same_answers,
)
from fish_study.archive import pack_studies
from fish_study.new_study import Asked, begin_or_go_on
from fish_study.study import Study, StudyError, read_json

NULLS = Asked(3, ["null"], 4, 20.0, 5, frozenset({"scenarios", "groups", "trials", "seed"}))


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
