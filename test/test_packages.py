# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Package manifests: every import is declared, by a rosdep key where one exists and in requirements-ros.txt otherwise."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[1]
MANIFESTS = sorted((ROOT / "src").glob("*/package.xml"))
# rosdep's key of a Python package; what is not here has the name of its ROS package
KEYS = {
    "casadi": "casadi-pip",
    "cv2": "python3-opencv",
    "filterpy": "python3-filterpy-pip",
    "hypothesis": "python3-hypothesis",
    "jinja2": "python3-jinja2",
    "lz4": "python3-lz4",
    "numpy": "python3-numpy",
    "plotly": "python3-plotly",
    "pytest": "python3-pytest",
    "rich": "python3-rich",
    "rosbags": "python3-rosbags-pip",
    "scipy": "python3-scipy",
    "serial": "python3-serial",
    "smbus2": "python3-smbus2",
    "statsmodels": "python3-statsmodels-pip",
    "torch": "python3-torch",
    "yaml": "python3-yaml",
}
WITHOUT_KEY = {
    "foxglove",
    "mcap",
    "safetensors",
    "svgelements",
    "zstandard",
}  # in requirements-ros.txt
DISTRIBUTIONS = {"foxglove": "foxglove-sdk"}  # where a wheel has another name than its package
OPTIONAL = {("fish_sim", "torch")}  # fish_sim.torch_step is imported by those alone who have torch


def imports(folder: Path) -> set[str]:
    """Top-level packages that the files of a folder import, without Python's own."""
    found = set[str]()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(), str(path))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module.split(".")[0])
    return {name for name in found if name not in sys.stdlib_module_names}


def declared(manifest: Path, *kinds: str) -> set[str]:
    tree = ElementTree.parse(manifest)
    return {str(entry.text) for kind in kinds for entry in tree.iter(kind)}


@pytest.mark.parametrize("manifest", MANIFESTS, ids=lambda path: path.parent.name)
def test_a_manifest_declares_what_the_package_imports(manifest: Path) -> None:
    name = manifest.parent.name
    needed = {
        KEYS.get(one, one)
        for one in imports(manifest.parent / name) - WITHOUT_KEY - {name}
        if (name, one) not in OPTIONAL
    }
    assert needed - declared(manifest, "exec_depend", "depend") == set()


@pytest.mark.parametrize("manifest", MANIFESTS, ids=lambda path: path.parent.name)
def test_a_manifest_declares_what_its_tests_import(manifest: Path) -> None:
    folder = manifest.parent / "test"
    own = {manifest.parent.name, "conftest", *(path.stem for path in folder.rglob("*.py"))}
    needed = {KEYS.get(one, one) for one in imports(folder) - WITHOUT_KEY - own}
    assert needed - declared(manifest, "exec_depend", "depend", "test_depend") == set()


@pytest.mark.parametrize("manifest", MANIFESTS, ids=lambda path: path.parent.name)
def test_a_manifest_says_who_made_it_and_under_which_licence(manifest: Path) -> None:
    tree = ElementTree.parse(manifest)
    for tag in ("name", "version", "description", "maintainer", "author", "license"):
        assert (tree.findtext(tag) or "").strip(), tag
    licence = tree.find("license")
    assert licence is not None
    text = manifest.parent / licence.attrib["file"]
    assert text.read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_what_apt_does_not_bring_stands_in_the_requirements_of_the_full_ros() -> None:
    pinned = {
        line.split("==")[0]
        for name in ("requirements-ros.txt", "requirements-diagnose.txt", "requirements-train.txt")
        for line in (ROOT / name).read_text().splitlines()
        if re.match(r"[a-z]", line)
    }
    assert pinned >= {DISTRIBUTIONS.get(name, name) for name in WITHOUT_KEY}
    assert pinned >= {name for name, key in KEYS.items() if key.endswith("-pip")}


def test_every_file_says_whose_it_is_and_under_which_licence() -> None:
    names = subprocess.run(
        ["git", "ls-files", "*.py"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    header = ("# Copyright", "# SPDX-License-Identifier: Apache-2.0")
    without = [
        name
        for name in names
        if [line[: len(part)] for line, part in zip(lines_of(ROOT / name), header, strict=False)]
        != list(header)
    ]
    assert not without, f"without copyright header: {', '.join(without)}"


def lines_of(path: Path) -> list[str]:
    """The first lines of a file, less the one that names its interpreter."""
    lines = path.read_text(encoding="utf-8").splitlines()[:3]
    return lines[1:] if lines and lines[0].startswith("#!") else lines
