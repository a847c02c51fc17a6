# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What each package declares, and the parameters of its nodes."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import rclpy
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter

from fish_bag.sample_recordings import robot_recording
from fish_node.parameters import parameter_docs

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
from reference_pages.parameters import CONFIGS

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


SETTABLE = {
    "fish_control/planner": {"path", "path_args", "end", "speed"},
    "fish_control/controller": {"gains_lowest", "gains_highest"},
    "fish_vision/tracker": {"front_colour", "rear_colour", "tail_odd_colour", "tail_even_colour"},
}
TYPES = {
    bool: ParameterType.PARAMETER_BOOL,
    int: ParameterType.PARAMETER_INTEGER,
    float: ParameterType.PARAMETER_DOUBLE,
    str: ParameterType.PARAMETER_STRING,
}
LIST_TYPES = {
    int: ParameterType.PARAMETER_INTEGER_ARRAY,
    float: ParameterType.PARAMETER_DOUBLE_ARRAY,
    str: ParameterType.PARAMETER_STRING_ARRAY,
}


def needed(name, folder):
    """Parameters without which a node refuses to start."""
    if name == "fish_control/exciter":
        program = folder / "program.yaml"
        program.write_text("- {t: 0.0, amplitude: 9.0, frequency: 2.0, rudder: 0.0}\n")
        return {"program_file": program}
    if name == "fish_bag/recorder":
        return {"output": folder}
    if name == "fish_bag/replayer":
        robot_recording(folder / "trial")
        return {"recording": folder / "trial"}
    return {}


@pytest.fixture
def node(request, monkeypatch, tmp_path):
    """The node `package/executable`, made in this process; it opens no device before it begins."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "165")  # above those that other tests draw
    package, executable = request.param.split("/")
    module = importlib.import_module(f"{package}.nodes.{executable}")
    (kind,) = (
        c
        for _, c in inspect.getmembers(module, inspect.isclass)
        if issubclass(c, Node) and c.__module__ == module.__name__
    )
    given = [f"{key}:={value}" for key, value in needed(request.param, tmp_path).items()]
    rclpy.init(args=["--ros-args", *(word for text in given for word in ("-p", text))])
    made = kind()
    yield request.param, made
    made.destroy_node()
    rclpy.try_shutdown()


@pytest.mark.parametrize("node", CONFIGS, indirect=True)
def test_every_parameter_is_described(node):
    name, made = node
    defaults, docs = asdict(CONFIGS[name]()), parameter_docs(CONFIGS[name]())
    described = {d.name: d for d in made.describe_parameters(list(defaults))}
    assert set(described) == set(defaults)
    for parameter, value in defaults.items():
        descriptor, doc = described[parameter], docs[parameter]
        assert descriptor.description == doc.description != "", parameter
        assert descriptor.additional_constraints == doc.allowed
        expected = LIST_TYPES[type(value[0])] if isinstance(value, tuple) else TYPES[type(value)]
        assert descriptor.type == expected, parameter
        ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
        assert len(ranges) == (doc.interval is not None), parameter
        if doc.interval is not None:
            low, high = doc.interval
            assert ranges[0].from_value == pytest.approx(low)
            assert np.isinf(high) or ranges[0].to_value == pytest.approx(high)


@pytest.mark.parametrize("node", CONFIGS, indirect=True)
def test_what_is_not_taken_over_at_run_time_is_read_only(node):
    name, made = node
    for parameter, value in asdict(CONFIGS[name]()).items():
        same = Parameter(parameter, value=list(value) if isinstance(value, tuple) else value)
        result = made.set_parameters([same])[0]
        assert result.successful == (parameter in SETTABLE.get(name, ())), (
            f"{parameter}: {result.reason}"
        )
        assert result.successful or "read-only" in result.reason


REFUSED = [
    ("fish_control/planner", "speed", 9.0, "0.05"),
    ("fish_control/planner", "path", "??", "unknown path"),
    ("fish_control/planner", "path", "topic", "start the planner again"),
    ("fish_control/controller", "gains_lowest", [1.0], "expected six numbers, 0 to 10"),
    ("fish_control/controller", "gains_lowest", [11.0] * 6, "expected six numbers"),
    ("fish_vision/tracker", "front_colour", [200, 0, 0, 0], "expected two hues 0 to 179"),
]


@pytest.mark.parametrize(("node", "parameter", "value", "said"), REFUSED, indirect=["node"])
def test_a_wrong_change_is_refused_with_its_reason(node, parameter, value, said):
    _, made = node
    before = made.get_parameter(parameter).value
    result = made.set_parameters([Parameter(parameter, value=value)])[0]
    assert not result.successful
    assert said in result.reason
    assert made.get_parameter(parameter).value == before
