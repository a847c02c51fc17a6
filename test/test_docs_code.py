# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The Python of the pages runs: blocks below `<!-- test: run -->`, those of a page as one program."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from fish_sim.robot_file import load_robot

DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"<!-- test: (\w+) -->\n```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PAGES = [page for page in sorted(DOCS.rglob("*.md")) if "<!-- test:" in page.read_text()]


def blocks(page, kind):
    """(first line, text) of the blocks of one kind."""
    text = page.read_text()
    return [
        (text[: match.start(3)].count("\n") + 1, match[3])
        for match in BLOCK.finditer(text)
        if match[1] == kind
    ]


def program(page):
    """The blocks as one program, each line where it stands on the page."""
    lines = []
    for first, text in blocks(page, "run"):
        lines += [""] * (first - 1 - len(lines)) + text.splitlines()
    return "\n".join(lines) + "\n"


@pytest.mark.timeout(1800)  # half a minute of processor time, longer on a busy computer
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_pages_code_runs(page, tmp_path):
    """In a process of its own: a page may add an effect to the table."""
    script = tmp_path / f"{page.stem}.py"
    script.write_text(program(page))
    command = [sys.executable, str(script)]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, f"{page}, with its own line numbers:\n{result.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_marked_block_is_found(page):
    assert len(BLOCK.findall(page.read_text())) == page.read_text().count("<!-- test:")


def test_a_robot_file_on_a_page_can_be_read(tmp_path):
    ((_, text),) = blocks(DOCS / "explanation" / "the_fish.md", "robot")
    file = tmp_path / "robot.yaml"
    file.write_text(text)
    robot = load_robot(file)
    assert robot.parameters["head_mass"] == 3.9
    assert robot.effects["quadratic_drag"]["surge"] == 0.6
