# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may import whom, and the house style that tools can check."""

import ast
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[1]
# every package and those of the project that it may import; data flows down only, and each may import fish_node
MAY_IMPORT = {
    "fish_node": set(),
    "fish_report": set(),
    "fish_sim": {"fish_report"},
    "fish_vision": {"fish_report"},
    "fish_description": set(),
    "fish_control": {"fish_report"},
    "fish_hw": set(),
    "fish_bag": {"fish_report"},
    "fish_sysid": {"fish_report", "fish_bag", "fish_sim", "fish_control"},
    "fish_train": {"fish_report", "fish_sim", "fish_control"},
    "fish_bringup": {"fish_report", "fish_bag", "fish_sim", "fish_control"},
    "fish_study": {
        "fish_report",
        "fish_bag",
        "fish_sim",
        "fish_control",
        "fish_sysid",
        "fish_train",
    },
}
PACKAGES = tuple(MAY_IMPORT)
FOLDERS = {name: ROOT / ("studies" if name == "fish_study" else "src") / name for name in PACKAGES}
ROS = ("rclpy", "rcl_interfaces", "launch", "launch_ros", "rosgraph_msgs", "builtin_interfaces")
LONGEST_MODULE, LONGEST_FUNCTION = 300, 60  # lines
GRAPH_FOLDERS = ("nodes", "launch", "test", "benchmarks")
SOURCES = [
    (name, path) for name, folder in FOLDERS.items() for path in sorted(folder.rglob("*.py"))
]


def imported(path):
    """(line, top-level package) of everything a file imports, wherever it stands."""
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name.split(".")[0]) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.lineno, node.module.split(".")[0]


def is_ros(name):
    return name in ROS or name.endswith(("_msgs", "_srvs"))


def may_import(package, path):
    """Packages of the project that a file may import; tests also what package.xml declares for them."""
    allowed = {package, "fish_node"} | MAY_IMPORT[package]
    if "test" in path.relative_to(FOLDERS[package]).parts:
        manifest = ElementTree.parse(FOLDERS[package] / "package.xml")
        allowed |= {entry.text for entry in manifest.iter("test_depend")}
    return allowed


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_only_what_they_may(package):
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for owner, path in SOURCES
        if owner == package
        for line, name in imported(path)
        if name in PACKAGES and name not in may_import(package, path)
    ]
    assert not wrong, "\n".join(wrong)


def test_only_nodes_know_ros():
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for package, path in SOURCES
        if not set(GRAPH_FOLDERS) & set(path.relative_to(FOLDERS[package]).parts)
        for line, name in imported(path)
        if is_ros(name)
    ]
    assert not wrong, "\n".join(wrong)


def test_modules_and_functions_are_small():
    """One page of screen for a function, five for a module; tests and benchmarks may be longer."""
    wrong = []
    for _, path in SOURCES:
        if {"test", "benchmarks"} & set(path.parts):
            continue
        text = path.read_text()
        if len(text.splitlines()) > LONGEST_MODULE:
            wrong.append(f"{path.relative_to(ROOT)}: more than {LONGEST_MODULE} lines")
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = node.end_lineno - node.lineno + 1
                if lines > LONGEST_FUNCTION:
                    place = f"{path.relative_to(ROOT)}:{node.lineno}"
                    wrong.append(f"{place} {node.name}: {lines} lines, at most {LONGEST_FUNCTION}")
    assert not wrong, "\n".join(wrong)


def test_one_console_for_all_verbs():
    """fish_report.terminal: its console takes no text of a file for markup."""
    wrong = [
        f"{path.relative_to(ROOT)}: use fish_report.terminal.terminal()"
        for _, path in SOURCES
        if path.name != "terminal.py"
        and "test" not in path.parts
        and re.search(r"\bConsole\(", path.read_text())
    ]
    assert not wrong, "\n".join(wrong)


def test_only_training_needs_torch():
    """The wheel is large: identify, diagnose, prove and evaluate are installed without it."""
    code = """
import importlib, pkgutil, sys, fish_bag, fish_study, fish_sysid, fish_train
training = ("fish_train.training.", "fish_study.paper_")  # `paper` trains nine seeds
for package in (fish_bag, fish_sysid, fish_train, fish_study):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.startswith((*training, "fish_bag.nodes")):
            importlib.import_module(module.name)
assert not {"torch", "tensorboard"} & set(sys.modules)
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize(
    "check", [["check"], ["format", "--check"]], ids=["ruff check", "ruff format"]
)
def test_ruff(check):
    program = shutil.which("ruff", path=str(Path(sys.executable).parent))
    command = [program, *check, "--output-format", "concise", "."]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, "\n" + result.stdout + result.stderr


@pytest.mark.timeout(900)  # a minute of processor time without its cache
def test_mypy():
    program = shutil.which("mypy", path=str(Path(sys.executable).parent))
    packages = [str(FOLDERS[name] / name) for name in PACKAGES]
    result = subprocess.run([program, *packages], cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, "\n" + result.stdout + result.stderr


@pytest.mark.parametrize("package", ["fish_sim", "fish_train", "fish_sysid", "fish_report"])
def test_every_data_file_of_a_package_is_installed(package):
    """C texts and page templates are read at run time: a file that setup.py forgets is missing only when installed."""
    source = FOLDERS[package] / package
    wanted = {p.relative_to(source) for s in ("*.c", "*.h", "*.j2") for p in source.rglob(s)}
    installed = Path(importlib.util.find_spec(package).origin).parent
    assert wanted
    assert [str(p) for p in sorted(wanted) if not (installed / p).exists()] == []
