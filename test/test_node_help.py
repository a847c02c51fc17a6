# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every node's executable with --help says what it is and starts nothing."""

import importlib
import sys
from pathlib import Path

import pytest
import rclpy

from fish_control.nodes import entry

NODES = {
    "fish_sim": ("simulator", "camera"),
    "fish_vision": ("tracker",),
    "fish_description": ("joint_angles",),
    "fish_control": ("fusion", "planner", "controller", "exciter"),
    "fish_hw": ("rotor", "rudder", "imu", "camera"),
    "fish_bag": ("recorder", "replayer"),
}


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize(
    ("package", "name"), [(p, name) for p, names in NODES.items() for name in names]
)
def test_help_says_what_a_node_is_and_starts_nothing(package, name, flag, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, flag])
    monkeypatch.setattr(rclpy, "init", lambda *_, **__: pytest.fail("started"))
    assert getattr(importlib.import_module(f"{package}.nodes.entry"), name)() == 0
    usage, what, parameters = capsys.readouterr().out.splitlines()
    assert usage.startswith(f"usage: {name} ")
    assert what
    assert Path(parameters.split(": ")[1]).name == f"{name}.yaml"
    assert Path(parameters.split(": ")[1]).exists()


def test_help_of_several_nodes_in_one_process_names_them(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["pilot", "--help"])
    monkeypatch.setattr(rclpy, "init", lambda *_, **__: pytest.fail("started"))
    assert entry.pilot() == 0
    usage, what, parameters = capsys.readouterr().out.splitlines()
    assert usage.startswith("usage: pilot --ros-args -r __ns:=/fish --fusion --params-file FILE")
    assert "fusion, planner and controller" in what
    assert parameters.endswith("config/NODE.yaml")
