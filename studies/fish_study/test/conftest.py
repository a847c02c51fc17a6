# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A finished study of three scenarios, run by a stand-in for the tool."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from prove_samples import three_scenarios

from fish_study.runner import run_study
from fish_study.study import Study, StudyError, read_json
from fish_study.tool_version import tool_digest

TOOL = (sys.executable, str(Path(__file__).with_name("fake_tool.py")))


@pytest.fixture(scope="session")
def ran(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A study of three scenarios that was stopped at its last one and went on; on the second the tool fails."""
    study = Study.create(
        tmp_path_factory.mktemp("ran") / "study",
        three_scenarios(),
        {"seed": 1, "began": "today", "command": "test", "tool": tool_digest()},
    )
    commitments, done = read_json(study.folder / "commitments.json"), []
    left = study.folder_of("scenario_0000") / "recordings" / "half"  # of a run that was killed
    left.mkdir(parents=True)
    with pytest.raises(StudyError, match="scenario_0002: the tool was stopped"):
        run_study(study, 1, done.append, TOOL)
    stopped = SimpleNamespace(done=list(done), left=study.pending)
    run_study(study, 1, done.append, TOOL)
    return SimpleNamespace(study=study, commitments=commitments, stopped=stopped, done=done)


@pytest.fixture
def study(ran: SimpleNamespace, tmp_path: Path) -> Study:
    """A copy of that study, nothing opened yet."""
    shutil.copytree(ran.study.folder, tmp_path / "study")
    return Study(tmp_path / "study")
