# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The version of the tool is that of the code that its answers depend on."""

from __future__ import annotations

from pathlib import Path

import pytest

from fish_study import tool_version
from fish_study.tool_version import tool_digest


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
