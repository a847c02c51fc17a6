# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 param describe` and `ros2 param set` for every parameter of every node."""

import importlib
import inspect
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import rclpy
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter

from fish_bag.sample_recordings import robot_recording
from fish_node.parameter_docs import parameter_docs

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
from reference_pages.parameters import CONFIGS

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
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
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
