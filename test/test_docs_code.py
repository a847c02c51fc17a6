"""The Python of the pages runs: blocks below `<!-- test: run -->`, those of a page one after the other."""

import re
from pathlib import Path

import pytest

from fish_sim.robot import load_robot

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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_pages_code_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for line, text in blocks(page, "run"):
        exec(compile("\n" * (line - 1) + text, str(page), "exec"), names)


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
