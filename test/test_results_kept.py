# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""No work is lost at its end: outputs are tried before it, and Ctrl-C keeps what is finished."""

import json
from pathlib import Path

import numpy as np
import pytest

from fish_bag import sample_recordings as samples
from fish_report import robofish as command
from fish_sysid.coverage import Repetition
from fish_train.evaluation.follow import NO_SIZES, RunMetrics
from fish_train.evaluation.study import Row

GAINS = "0.3,0.3,0.03,0.6,0.05,0"
EVALUATE = [
    "evaluate",
    "--constant",
    GAINS,
    "--paths",
    "R",
    "I",
    "--speeds",
    "0.1",
    "0.2",
    "--robust",
    "--jobs",
    "1",
]


def never(*_: object, **__: object) -> None:
    pytest.fail("the work began")


@pytest.fixture
def nothing_works(monkeypatch: pytest.MonkeyPatch) -> None:
    for work in (
        "fish_sysid.coverage.study",
        "fish_sysid.identification.identify",
        "fish_sysid.diagnosis.pipeline.diagnose",
        "fish_train.evaluation.study.evaluate",
    ):
        monkeypatch.setattr(work, never)


@pytest.mark.parametrize("verb", ["identify", "diagnose", "evaluate", "coverage"])
@pytest.mark.parametrize(
    "out", ["file", "file/under/it", "/proc/self"], ids=["a file", "under a file", "takes no file"]
)
def test_an_output_that_cannot_be_written_is_said_before_the_work(
    verb: str, out: str, tmp_path: Path, nothing_works: None, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine")
    words = {"evaluate": EVALUATE, "coverage": ["coverage"]}.get(verb)
    if words is None:
        samples.robot_recording(tmp_path / "trial")
        words = [verb, str(tmp_path / "trial")]
    place = tmp_path / out
    if verb == "coverage":  # a file in that folder; where it is there already it may be replaced
        place = place / "coverage.json"
    capsys.readouterr()
    assert command.main([*words, "--out", str(place)]) == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert f"robofish {verb}: --out " in said
    assert "choose another" in said
    assert (tmp_path / "file").read_text() == "mine"


def test_the_file_of_a_coverage_study_may_not_be_a_folder(
    tmp_path: Path, nothing_works: None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command.main(["coverage", "--out", str(tmp_path)]) == 1
    assert "is a folder; expected a file" in capsys.readouterr().err


def test_repetitions_that_are_finished_outlive_ctrl_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def repeat(seed: int, trials: int, duration: float) -> Repetition:
        if seed == 2:
            raise KeyboardInterrupt
        return Repetition(seed, ("head_mass",), np.array([0.5 + 2.0 * seed]), np.array([0.1]))

    monkeypatch.setattr("fish_sysid.coverage.repeat", repeat)
    out = tmp_path / "new" / "coverage.json"
    assert command.main(["coverage", "--study", "5", "--out", str(out)]) == 130
    assert "2 of 5 repetitions" in capsys.readouterr().out
    content = json.loads((out.parent / "coverage_partial.json").read_text())
    assert content["inside95"] == 0.5
    assert set(content["scores"]) == {"0", "1"}
    assert not out.exists()
    # nothing finished, nothing written
    assert (
        command.main(["coverage", "--seed", "2", "--out", str(tmp_path / "none" / "c.json")]) == 130
    )
    assert list((tmp_path / "none").iterdir()) == []


def test_runs_that_are_finished_outlive_ctrl_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    batches = 0

    def evaluate(candidate, condition, cells) -> list[Row]:
        nonlocal batches
        batches += 1
        if batches == 3:
            raise KeyboardInterrupt
        metrics = RunMetrics(NO_SIZES, NO_SIZES, 0.0, "")
        return [Row(candidate.name, condition.name, cell, metrics) for cell in cells]

    monkeypatch.setattr("fish_train.evaluation.study.evaluate", evaluate)
    (tmp_path / "runs.csv").write_text("of yesterday")
    assert command.main([*EVALUATE, "--seeds", "1", "--out", str(tmp_path)]) == 130
    assert (
        "8 of 16 runs; runs_partial.csv and evaluation_partial.html in" in capsys.readouterr().out
    )
    assert len((tmp_path / "runs_partial.csv").read_text().splitlines()) == 1 + 8
    assert "Tracking" in (tmp_path / "evaluation_partial.html").read_text()
    assert (tmp_path / "runs.csv").read_text() == "of yesterday"


def late_or_interrupted(place: int) -> int:
    """In a worker: the first task takes longer than the second."""
    import time

    time.sleep(2.0 if place == 0 else 0.0)
    return place


def test_batches_are_kept_as_they_come_and_returned_in_order() -> None:
    from fish_train.evaluation.study import _in_processes

    kept: list[tuple[int, int]] = []
    tasks = [(0,), (1,)]
    assert _in_processes(late_or_interrupted, tasks, 2, keep=lambda *said: kept.append(said)) == [
        0,
        1,
    ]
    assert kept == [(1, 1), (0, 0)]
