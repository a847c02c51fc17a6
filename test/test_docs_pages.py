# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the pages say of parameters, arguments and messages is what the code has."""

import ast
import importlib.util
import inspect
import re
from pathlib import Path

from fish_control.paths import PATHS
from fish_sim.robot import Robot, nominal_parameters
from fish_sysid.diagnosis.task import STAGES

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def rows(text):
    """The cells of every table row, without headings' rules."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[c.strip() for c in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


def test_the_table_of_the_fish_has_every_parameter_with_unit_and_value():
    page = (DOCS / "explanation" / "the_fish.md").read_text()
    table = page.split("<!-- parameters: begin -->")[1].split("<!-- parameters: end -->")[0]
    shown = {row[0].strip("`"): (row[2], row[3]) for row in rows(table)[2:]}
    assert shown == {name: (p.unit, f"{p.value:.6g}") for name, p in nominal_parameters().items()}


def test_the_table_of_stages_has_all_that_can_be_left_out():
    page = (DOCS / "explanation" / "diagnosis.md").read_text()
    table = page.split("## Stages that can be left out")[1].split("\n## ")[0]
    assert [tuple(row) for row in rows(table)[2:]] == list(STAGES)


def test_the_picture_of_the_fish_is_current():
    script = DOCS / "images" / "the_fish.py"
    spec = importlib.util.spec_from_file_location("the_fish", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.drawing(Robot()) == script.with_suffix(".svg").read_text()


def test_the_table_of_paths_has_every_argument_with_its_default():
    page = (DOCS / "how_to" / "paths.md").read_text().split("## Families")[1].split("\n## ")[0]
    shown, family = {}, ""
    for row in rows(page)[2:]:
        family = row[0].strip("`") or family
        names, defaults = row[1].replace("`", "").split(", "), row[2].split(", ")
        shown.setdefault(family, {}).update(zip(names, defaults, strict=True))
    assert list(shown) == sorted(PATHS)
    for family, arguments in shown.items():
        parameters = inspect.signature(PATHS[family]).parameters
        own = {name: p.default for name, p in parameters.items() if name != "end"}
        assert set(arguments) == set(own), family
        for name, default in own.items():
            text = (
                "none"
                if default in (None, "")
                else f"{default:.4g}"
                if name == "start"
                else str(default)
            )
            assert arguments[name] == text, f"{family}: {name}"


def source_strings():
    """Every string of the packages' sources; what an f-string inserts is the character 0."""
    for file in sorted((ROOT / "src").glob("*/fish_*/**/*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value
            elif isinstance(node, ast.JoinedStr):
                yield "".join(v.value if isinstance(v, ast.Constant) else "\0" for v in node.values)


def test_every_message_that_is_explained_is_in_the_source():
    page = (DOCS / "how_to" / "something_went_wrong.md").read_text()
    said = [row[0].strip("`") for row in rows(page) if row[0].startswith("`")]
    source = "\n".join(source_strings())
    assert len(said) > 50
    missing = [
        line
        for line in said
        if not re.search(".*".join(re.escape(part) for part in line.split("...")), source)
    ]
    assert missing == []
