# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The documentation: links, quoted messages, code that runs, generated pages."""

import argparse
import ast
import importlib
import importlib.util
import inspect
import re
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest

from fish_control.paths import PATHS
from fish_report.robofish import BROUGHT_BY, installed_verbs
from fish_sim.effects import EFFECTS
from fish_sim.robot import Robot, nominal_parameters
from fish_sim.robot_file import load_robot
from fish_sim.step import Stepper
from fish_sysid.diagnosis.task import STAGES

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted(page for page in DOCS.rglob("*.md") if not {"studies", "_build"} & set(page.parts)),
    *sorted(ROOT.glob("s*/*/README.md")),
    *sorted(ROOT.glob("s*/*/docs/*.md")),
    *sorted(ROOT.glob("examples/*/README.md")),
]
EVERY_PAGE = [pytest.param(page, id=str(page.relative_to(ROOT))) for page in PAGES]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def prose(page):
    """A page without its code, in which # begins a comment and not a heading."""
    return FENCE.sub("", page.read_text())


def anchors(page):
    """What GitHub calls the page's headings: small letters, words joined by hyphens, namesakes numbered from 1 on."""
    names = []
    for title in re.findall(r"^#{1,6} +(.+?) *#* *$", prose(page), re.MULTILINE):
        shown = re.sub(r"\[(.*?)\]\(.*?\)", r"\1", title)
        names.append(re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-"))
    before = [names[:k].count(name) for k, name in enumerate(names)]
    return [f"{name}-{n}" if n else name for name, n in zip(names, before, strict=True)]


def dead_links(page):
    """Targets within the project that are not there: files, and headings of Markdown pages."""
    dead = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        file, _, anchor = target.partition("#")
        place = page.parent / file if file else page
        if re.match(r"[a-z]+:", target):  # not of the project
            continue
        if not place.exists() or (
            anchor and place.suffix == ".md" and anchor not in anchors(place)
        ):
            dead.append(target)
    return dead


@pytest.mark.parametrize("page", EVERY_PAGE)
def test_links_lead_somewhere(page):
    assert dead_links(page) == []


def test_a_link_to_a_heading_that_is_not_there_is_dead(tmp_path):
    (tmp_path / "there.md").write_text(
        "# What `it` is (2)\n```\n# no heading\n```\n## Twice 2\n## Twice\n## Twice\n"
    )
    page = tmp_path / "page.md"
    alive = (
        "there.md",
        "there.md#what-it-is-2",
        "there.md#twice-2",
        "there.md#twice-1",
        "#here",
        "https://a.b/#c",
    )
    dead = ("gone.md", "gone.md#twice", "there.md#no-heading", "there.md#twice-3", "#there")
    page.write_text("# Here\n" + " ".join(f"[a]({target})" for target in (*alive, *dead)))
    assert dead_links(page) == list(dead)


def test_every_entry_of_the_tables_of_contents_is_a_page():
    entries = [
        entry
        for _, body in re.findall(
            r"^```\{(toctree)\}\n(.*?)^```",
            (DOCS / "index.md").read_text(),
            re.DOTALL | re.MULTILINE,
        )
        for entry in body.split("\n\n", 1)[1].split()
    ]
    assert entries
    assert [entry for entry in entries if not (DOCS / f"{entry}.md").exists()] == []


@pytest.mark.parametrize("page", EVERY_PAGE)
def test_python_examples_compile_and_their_imports_are_there(page):
    for language, code in FENCE.findall(page.read_text()):
        if language != "python":
            continue
        tree = ast.parse(code)
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    importlib.import_module(alias.name)
            elif isinstance(node, ast.ImportFrom):
                module = importlib.import_module(node.module)
                missing = [a.name for a in node.names if not hasattr(module, a.name)]
                assert missing == [], node.module


def test_the_effect_of_the_readme_turns_a_fish():
    (code,) = [
        code
        for language, code in FENCE.findall((ROOT / "README.md").read_text())
        if language == "python"
    ]
    before = dict(EFFECTS)
    try:
        exec(code, {})
        (name,) = set(EFFECTS) - set(before)
        parameter, value = next(
            (key, p.typical) for key, p in EFFECTS[name].parameters.items() if p.typical
        )
        headings = []
        for strength in (0.0, value):
            robot = Robot().with_effect(name, **{parameter: strength})
            stepper = Stepper.of(robot)
            commands = [[60.0 * (-1.0) ** (k // 25), 0.3] for k in range(100)]
            last = stepper.rollout(stepper.rest(), commands, stepper.parameters(robot))[-1]
            headings.append(last[2])
        assert headings[0] != pytest.approx(headings[1], abs=1e-4)
    finally:
        EFFECTS.clear()
        EFFECTS.update(before)


def commands(page):
    """Lines of code without a language, and code within prose, without comments and with continued lines joined."""
    text = page.read_text()
    lines = [
        line
        for language, code in FENCE.findall(text)
        if language in ("", "bash")
        for line in code.replace("\\\n", " ").splitlines()
    ]
    lines += [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", prose(page))]
    return [
        part.strip()
        for line in lines
        for part in re.split(r"&&|;|\|", line.partition(" #")[0])
        if part.strip()
    ]


def options(verb):
    """All option names of a verb and of its sub-commands."""
    parser = argparse.ArgumentParser()
    importlib.import_module(f"{BROUGHT_BY[verb]}.verbs.{verb}").add_arguments(parser)
    text = parser.format_help()
    for action in parser._actions:
        if isinstance(action.choices, dict):
            text += "".join(sub.format_help() for sub in action.choices.values())
    return set(re.findall(r"--[a-z][a-z-]*", text))


def flags(text):
    return set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", text))


def wrong_commands(page):
    """Commands of the project that do not exist, or that do not take an option they are given."""
    targets = set(
        re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split()
    )
    wrong = []
    for line in commands(page):
        words = line.split()
        if words[0] == "robofish" and len(words) > 1 and re.fullmatch(r"[a-z_]+", words[1]):
            if words[1] not in BROUGHT_BY or flags(line) - options(words[1]):
                wrong.append(line)
        elif words[0] == "make" and len(words) > 1 and re.fullmatch(r"[a-z]+,?", words[1]):
            target = words[1].rstrip(",")
            given = flags(re.sub(r"PIP_ARGS=('[^']*'|\S*)", "", line))
            if target not in targets or (target in BROUGHT_BY and given - options(target)):
                wrong.append(line)
        elif words[:2] == ["ros2", "run"] and len(words) > 3 and words[2].startswith("fish_"):
            scripts = distribution(words[2]).entry_points.select(group="console_scripts")
            if words[3] not in {script.name for script in scripts}:
                wrong.append(line)
        elif words[:2] == ["ros2", "launch"] and len(words) > 3 and words[2].startswith("fish_"):
            if not (ROOT / "src" / words[2] / "launch" / words[3]).exists():
                wrong.append(line)
        elif words[0] == "python" and len(words) > 1 and words[1].endswith(".py"):
            if not (ROOT / words[1]).exists():
                wrong.append(line)
    return wrong


@pytest.mark.parametrize("page", EVERY_PAGE)
def test_commands_exist_with_their_options(page):
    assert wrong_commands(page) == []


def test_a_command_or_option_that_is_not_there_is_wrong(tmp_path):
    page = tmp_path / "page.md"
    wrong = [
        "robofish dance",
        "robofish score RECORDING --loud",
        "make coffee",
        "make demo ARGS='--loud'",
        "ros2 run fish_hw toaster",
        "ros2 launch fish_bringup cat.launch.py",
        "python examples/gone.py",
    ]
    right = "robofish score RECORDING --out page.html   # the page\nmake demo LETTER=S"
    page.write_text("```\n" + "\n".join([*wrong, right]) + "\n```\nand `make coffee`\n")
    assert wrong_commands(page) == [*wrong, "make coffee"]


STARTS_ONE_NODE = re.compile(r"^(ros2 run|install/\S+) .*--ros-args", re.MULTILINE)


@pytest.mark.parametrize("page", EVERY_PAGE)
def test_single_nodes_are_started_on_the_loopback_interface(page):
    """Whoever reaches the topics can drive the motor: no page opens ports to the network by the way."""
    for _, code in FENCE.findall(page.read_text()):
        node = STARTS_ONE_NODE.search(code)
        assert node is None or 'eval "$(robofish loopback)"' in code[: node.start()], code


def test_the_generated_pages_are_current():
    result = subprocess.run(
        [sys.executable, "docs/generate_reference.py", "--check"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_every_installed_verb_of_the_project_is_in_the_reference():
    sections = re.findall(
        r"^## (\w+)$", (DOCS / "reference" / "verbs.md").read_text(), re.MULTILINE
    )
    own = [verb for verb, entry in installed_verbs().items() if entry.value.startswith("fish_")]
    assert sorted(sections) == sorted(own)


# requirements-noble.txt has the versions of Ubuntu 24.04, of packages that the others name
REQUIREMENTS = sorted(set(ROOT.glob("requirements*.txt")) - {ROOT / "requirements-noble.txt"})


@pytest.mark.parametrize("file", REQUIREMENTS, ids=lambda file: file.name)
def test_every_dependency_is_pinned_and_has_a_reason(file):
    rows = re.findall(
        r"^\|(.*?)\|(.*?)\|(.+?)\|$",
        (DOCS / "reference" / "dependencies.md").read_text(),
        re.MULTILINE,
    )
    reasons, of_file = set(), ""
    for first, packages, _ in rows:
        of_file = first.strip("` ") or of_file
        if of_file == file.name:
            reasons |= {name.strip().lower() for name in packages.split(",")}
    pins = [line for line in file.read_text().splitlines() if line and not line.startswith("#")]
    names = {pin.split("==")[0].split("[")[0].lower() for pin in pins}
    assert all(re.fullmatch(r"[^=]+==\S+", pin) for pin in pins)
    assert names == reasons
    constraints = (ROOT / "constraints.txt").read_text().lower().splitlines()
    if file.name != "requirements-bench.txt":
        assert {re.sub(r"\[.*?\]", "", pin.lower()) for pin in pins} <= set(constraints)


CODE_DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"<!-- test: (\w+) -->\n```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
CODE_PAGES = [page for page in sorted(CODE_DOCS.rglob("*.md")) if "<!-- test:" in page.read_text()]


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
@pytest.mark.parametrize("page", CODE_PAGES, ids=lambda page: page.stem)
def test_the_pages_code_runs(page, tmp_path):
    """In a process of its own: a page may add an effect to the table."""
    script = tmp_path / f"{page.stem}.py"
    script.write_text(program(page))
    command = [sys.executable, str(script)]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, f"{page}, with its own line numbers:\n{result.stderr}"


@pytest.mark.parametrize("page", CODE_PAGES, ids=lambda page: page.stem)
def test_every_marked_block_is_found(page):
    assert len(BLOCK.findall(page.read_text())) == page.read_text().count("<!-- test:")


def test_a_robot_file_on_a_page_can_be_read(tmp_path):
    ((_, text),) = blocks(CODE_DOCS / "explanation" / "the_fish.md", "robot")
    file = tmp_path / "robot.yaml"
    file.write_text(text)
    robot = load_robot(file)
    assert robot.parameters["head_mass"] == 0.51
    assert robot.effects["quadratic_drag"]["surge"] == 0.6


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
