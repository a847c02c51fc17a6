# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Running the tool on scenarios: what it is given, what is kept, what happens when it fails or is stopped."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from prove_samples import small

from fish_study import runner
from fish_study.runner import Job, run_scenario, run_study
from fish_study.study import Study, StudyError, read_json

TOOL = (sys.executable, str(Path(__file__).with_name("fake_tool.py")))


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
