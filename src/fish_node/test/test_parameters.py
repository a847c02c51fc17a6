# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameter files, their documentation, and the domain."""

import socket
from dataclasses import dataclass
from pathlib import Path

import pytest
import rclpy
from rclpy.node import Node

from fish_node import domain
from fish_node.frames import require_frame, require_frame_prefix
from fish_node.parameter_file import read_node_parameters, read_settings
from fish_node.parameters import ParameterDoc, interval, parameter_docs

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
        ("[" * 20_000, "maximum recursion depth"),
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


@dataclass(frozen=True)
class Base:
    rate: float = 2.0  # Hz, of nothing

    def __post_init__(self) -> None:
        if not 1.0 <= self.rate <= 5.0:
            raise ValueError(f"rate is {self.rate}, expected 1 to 5 Hz")


@dataclass(frozen=True)
class DocumentedSettings(Base):
    fast: float = 3.0  # Hz, at least rate
    count: int = 1  # of things
    mode: str = "a"  # a or b
    on: bool = False  # whether
    free: float = 0.0  # anything

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.rate <= self.fast <= 9.0:
            raise ValueError(f"fast is {self.fast}, expected {self.rate} to 9 Hz")
        if self.count < 1:
            raise ValueError(f"count is {self.count}, expected at least 1")
        if self.mode not in ("a", "b"):
            raise ValueError(f"mode is {self.mode!r}; known: a, b")


def test_a_field_s_comment_is_its_description_and_its_refusal_its_range() -> None:
    assert parameter_docs(DocumentedSettings()) == {
        "rate": ParameterDoc("Hz, of nothing", "1 to 5 Hz", (1.0, 5.0)),
        "fast": ParameterDoc("Hz, at least rate", "2.0 to 9 Hz", (2.0, 9.0)),
        "count": ParameterDoc("of things", "at least 1", (1.0, float("inf"))),
        "mode": ParameterDoc("a or b", "a, b", None),
        "on": ParameterDoc("whether", "true, false", None),
        "free": ParameterDoc("anything", "", None),
    }


def test_a_range_that_depends_on_another_value_follows_it() -> None:
    assert parameter_docs(DocumentedSettings(rate=3.0, fast=4.0))["fast"].interval == (3.0, 9.0)


@pytest.mark.parametrize(
    ("said", "bounds"),
    [
        ("0.05 to 0.5 m/s", (0.05, 0.5)),
        ("-1 to 1e-06", (-1.0, 1e-6)),
        ("0.005 < lookahead <= 2.0", (0.005, 2.0)),
        ("> -0.5", (-0.5, float("inf"))),
        ("1, -1", None),
        ("three numbers", None),
    ],
)
def test_bounds_are_read_from_words(said: str, bounds: tuple[float, float] | None) -> None:
    assert interval(said) == bounds


@pytest.mark.parametrize("prefix", ["fish_2", "/fish/", "a b/", "2/"])
def test_a_wrong_prefix_is_refused(prefix: str) -> None:
    require_frame_prefix("")
    require_frame_prefix("lab/fish_2/")
    with pytest.raises(ValueError, match="end with a slash, such as 'fish_2/'"):
        require_frame_prefix(prefix)


@pytest.mark.parametrize("frame", ["", "/pool", "the pool"])
def test_a_wrong_frame_is_refused(frame: str) -> None:
    require_frame("pool_frame", "fish_2/base_link")
    with pytest.raises(ValueError, match=r"pool_frame is .*without a slash in front"):
        require_frame("pool_frame", frame)


def test_ports_are_those_of_the_standard():
    # OMG DDSI-RTPS: domain 0, participants 0 and 1 listen on 7410 and 7412; domain 1 starts 250 higher
    assert [
        domain.discovery_port(0, 0),
        domain.discovery_port(0, 1),
        domain.discovery_port(1, 0),
    ] == [
        7410,
        7412,
        7660,
    ]


def test_a_domain_with_a_participant_is_in_use_and_refused():
    free = 230  # no test draws it, and its ports lie above Linux' ephemeral ones
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("", domain.discovery_port(free, 3)))
        assert domain.domain_in_use(free)
        with pytest.raises(domain.DomainError, match=f"domain {free} is in use"):
            domain.choose_domain(free)
    assert domain.choose_domain(free) == free
    assert domain.choose_domain() in domain.FREE_RANGE


@pytest.mark.parametrize("number", [-1, 233])
def test_a_domain_out_of_range_is_refused(number):
    with pytest.raises(domain.DomainError, match="0 to 232"):
        domain.choose_domain(number)


def test_all_domains_in_use_is_said(monkeypatch):
    monkeypatch.setattr(domain, "domain_in_use", lambda _: True)
    with pytest.raises(domain.DomainError, match="all ROS domains"):
        domain.choose_domain()
