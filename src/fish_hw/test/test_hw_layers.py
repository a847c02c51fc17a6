# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may import what, so that the layers stay layers."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "fish_hw"
LAYERS = {
    "settings": set(),
    "protocol": {"protocol"},
    "transport": {"transport", "settings"},
    "devices": {"devices", "protocol", "transport", "settings"},
    "emulators": {"emulators", "devices", "protocol", "transport", "settings"},
    "safe_stop": {"devices", "transport", "settings"},
    "nodes": {"nodes", "emulators", "devices", "protocol", "transport", "settings"},
}
PORTS = {"serial", "smbus2"}
ROS = {
    "rclpy",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "diagnostic_msgs",
    "builtin_interfaces",
    "rcl_interfaces",
}
OTHERS = {
    "fish_sim",
    "fish_vision",
    "fish_control",
    "fish_train",
    "fish_bag",
    "fish_sysid",
    "fish_bringup",
}
FILES = sorted(PACKAGE.rglob("*.py"))


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports(path):
    layer = path.relative_to(PACKAGE).with_suffix("").parts[0]
    names = imports(path)
    roots = {name.split(".")[0] for name in names}
    assert not roots & OTHERS
    assert layer == "transport" or not roots & PORTS
    assert layer == "nodes" or not roots & ROS
    own = {name.split(".")[1] for name in names if name.startswith("fish_hw.")}
    assert own <= LAYERS.get(layer, set())
