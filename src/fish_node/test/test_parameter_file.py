# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a file has for a node is what ROS gives to it; where that is not clear, it is said."""

from dataclasses import dataclass
from pathlib import Path

import pytest
import rclpy
from rclpy.node import Node

from fish_node.parameter_file import read_node_parameters, read_settings

NODE = "/fish/rudder"
ONE, TWO = "{ros__parameters: {a: 1}}", "{ros__parameters: {a: 2, b: 2}}"
READ = [
    f"/**: {ONE}",
    f"'**': {ONE}",
    f"/fish/rudder: {ONE}",
    f"fish/rudder: {ONE}",
    f"/**/rudder: {ONE}",
    f"/*/rudder: {ONE}",
    f"/fish/*: {ONE}",
    f"/fish/**: {ONE}",
    f"/**/*: {ONE}",
    f"/fish/rudder/**: {ONE}",
    f"fish: {{rudder: {ONE}}}",
    f"/**: {{rudder: {ONE}}}",
    f"/**: {TWO}\n/fish/rudder: {ONE}",
    f"/fish/rudder: {ONE}\n/**: {TWO}",
    f"/**: {TWO}\n/**/rudder: {ONE}",
    f"/**: {TWO}\n/fish/rotor: {ONE}\n/fish/rudder: {ONE}\n/rotor: {ONE}",
    f"/**: {ONE}\n/fish/rudder: {{ros__parameters: {{c: 3}}}}\n/**: {TWO}",
    "/**: {ros__parameters: {}}",
]


@dataclass(frozen=True)
class Settings:
    a: float = 0.5
    b: int = 7

    def __post_init__(self) -> None:
        if self.a > 5.0:
            raise ValueError(f"a is {self.a}, expected at most 5")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "params.yaml"


@pytest.mark.ros
@pytest.mark.parametrize("text", READ)
def test_it_reads_what_the_node_reads(
    file: Path, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    file.write_text(text)
    rclpy.init(args=["--ros-args", "--params-file", str(file)], domain_id=143)
    node = Node("rudder", namespace="fish", automatically_declare_parameters_from_overrides=True)
    given = {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if name in ("a", "b", "c")
    }
    node.destroy_node()
    rclpy.shutdown()
    assert read_node_parameters(file, NODE) == given


def test_a_node_that_the_file_alone_names_in_another_namespace_is_meant(file: Path) -> None:
    file.write_text(f"/**: {TWO}\n/red/fish/rudder: {ONE}\n/red/**: {{ros__parameters: {{c: 3}}}}")
    assert read_node_parameters(file, NODE) == {"a": 1, "b": 2, "c": 3}


@pytest.mark.parametrize(
    ("text", "unread"),
    [
        (f"/fish/rudder: {ONE}\n/red/fish/rudder: {TWO}", "/red/fish/rudder"),
        (
            f"/red/fish/rudder: {ONE}\n/blue/fish/rudder: {TWO}",
            "/red/fish/rudder, /blue/fish/rudder",
        ),
        (f"/**: {ONE}\n/red/**: {TWO}", "/red/**"),
        (f"/**: {ONE}\nrudder: {TWO}", "/rudder"),  # of a node without a namespace
        (f"'*': {ONE}", "/*"),
    ],
)
def test_entries_that_could_be_meant_but_are_not_read_are_refused(
    file: Path, text: str, unread: str
) -> None:
    file.write_text(text)
    with pytest.raises(ValueError, match=r"params\.yaml: /fish/rudder does not read ") as caught:
        read_node_parameters(file, NODE)
    assert f"read {unread}, which could be meant for it" in str(caught.value)
    assert str(caught.value).endswith(
        "Expected entries of one robot only: /**, /**/rudder or /fish/rudder"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "No such file"),
        (b"\xff", "decode"),
        ("{bad: [", "while parsing"),
        (
            "",
            r"expected a node name with ros__parameters below it, such as /\*\* or /fish/rudder; found: none",
        ),
        ("[]", "found: none"),
        ("/**: 3", "found: none"),
        (f"/fish/rotor: {ONE}", "nothing for the node /fish/rudder; .* found: /fish/rotor"),
        ("/**: {ros__parameters: 3}", r"ros__parameters of /\*\* is 3, expected names and values"),
    ],
)
def test_what_is_no_parameter_file_of_the_node_is_refused(
    file: Path, text: str | bytes | None, said: str
) -> None:
    if text is not None:
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=r"params\.yaml.*" + said):
        read_node_parameters(file, NODE)


def test_settings_keep_their_defaults_and_unknown_ones_are_said(file: Path) -> None:
    said: list[str] = []
    file.write_text("/**: {ros__parameters: {a: 1, bb: 3, use_sim_time: true}}")
    assert read_settings(file, NODE, Settings, said.append) == Settings(a=1.0)
    assert said == [f"{file}: unknown parameter bb (did you mean b?); known: a, b"]


@pytest.mark.parametrize(
    ("value", "said"), [("9.0", "a is 9.0, expected at most 5"), ("x", "a is 'x', expected float")]
)
def test_settings_that_are_refused_name_the_file(file: Path, value: str, said: str) -> None:
    file.write_text(f"/**: {{ros__parameters: {{a: {value}}}}}")
    with pytest.raises(ValueError, match=rf"params\.yaml: {said}"):
        read_settings(file, NODE, Settings, pytest.fail)
