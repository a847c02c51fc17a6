# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How nodes start and stop, and which walls they take."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass

import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Header

from fish_node.nodes.start import read_parameters, run
from fish_node.pool import pool_sides

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def own_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", "143")


@dataclass(frozen=True)
class Config:
    rate: float = 1.0
    count: int = 2
    on: bool = False
    name: str = "a"
    place: tuple[float, ...] = (0.0, 1.0)


class Stopped(Node):
    """Publishes after its context was shut down, as a callback does that a signal interrupts."""

    def __init__(self) -> None:
        super().__init__("stopped")
        self._publisher = self.create_publisher(Header, "h", 1)
        self.create_timer(0.01, self._tick)

    def _tick(self) -> None:
        rclpy.shutdown()
        self._publisher.publish(Header())


class Broken(Node):
    def __init__(self) -> None:
        super().__init__("broken")
        raise RuntimeError("a real one")


class Mistaken(Node):
    """A node with a mistake in a callback."""

    def __init__(self) -> None:
        super().__init__("mistaken")
        self.create_timer(0.01, lambda: int("x"))


class Signalled(Node):
    """A signal comes while it is made, and what it does next fails for that."""

    def __init__(self, number: signal.Signals, error: Exception | None) -> None:
        super().__init__("signalled")
        os.kill(os.getpid(), number)
        deadline = time.monotonic() + 20.0
        while self.context.ok() and time.monotonic() < deadline:  # SIGINT interrupts this
            time.sleep(0.001)
        if error is not None:
            raise error
        self.create_publisher(Header, "h", 1)


def read(*overrides: str) -> Config:
    arguments = ["--ros-args"] + [a for text in overrides for a in ("-p", text)]
    rclpy.init(args=arguments)
    node = Node("reader", automatically_declare_parameters_from_overrides=True)
    try:
        return read_parameters(node, Config)
    finally:
        node.destroy_node()
        rclpy.shutdown()


def test_parameters_come_from_the_dataclass_and_the_command_line() -> None:
    assert read() == Config()
    given = read("rate:=3", "count:=5", "on:=true", "name:=b", "place:=[1, 2]")
    assert given == Config(3.0, 5, True, "b", (1.0, 2.0))
    assert isinstance(given.rate, float)


@pytest.mark.parametrize(
    "override", ["rate:=fast", "count:=2.5", "on:=1", "name:=3", "place:=1.0", "place:=[a, b]"]
)
def test_a_value_of_the_wrong_type_is_refused_with_its_name(override: str) -> None:
    with pytest.raises(ValueError, match=override.split(":")[0]):
        read(override)


def test_an_unknown_name_is_refused_and_the_nearest_suggested() -> None:
    assert read("use_sim_time:=false", "qos_overrides./h.publisher.depth:=3", "count:=5").count == 5
    with pytest.raises(
        ValueError,
        match=r"^unknown parameter cuont, x \(did you mean count\?\); known: count, name",
    ):
        read("cuont:=5", "x:=1", "rate:=2.0")


@pytest.mark.parametrize("given", [[], ["-p", "rate:=3.0"]], ids=["default", "given at the start"])
def test_a_change_at_run_time_is_refused_and_changes_nothing(given: list[str]) -> None:
    """It was reported as set, unchecked, and did nothing: the node had read its parameters."""
    rclpy.init(args=["--ros-args", *given])
    node = Node("reader", automatically_declare_parameters_from_overrides=True)
    try:
        before = read_parameters(node, Config)
        changes = [
            Parameter("rate", value=-7.0),
            Parameter("name", value=4),
            Parameter("place", value=[2.0]),
        ]
        results = node.set_parameters(changes)
        assert [result.successful for result in results] == [False] * 3
        assert all("read-only" in result.reason for result in results)
        assert node.get_parameter("rate").value == before.rate
    finally:
        node.destroy_node()
        rclpy.shutdown()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "error",
    [None, ValueError("half made"), RuntimeError("half made"), OSError("half made")],
    ids=repr,
)
def test_a_signal_while_the_node_is_made_is_a_clean_end(
    number: signal.Signals, error: Exception | None, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(lambda: Signalled(number, error), "signalled") == 0
    assert "half made" not in capfd.readouterr().err
    assert not rclpy.ok()


@pytest.mark.parametrize("kind", [Stopped, Mistaken])
def test_only_a_node_that_ends_cleanly_is_told_of_its_end(kind: type[Node]) -> None:
    told: list[str] = []
    try:
        run(kind, "node", lambda node: told.append(node.get_name()))
    except ValueError:
        told.append("an error")
    assert told == {Stopped: ["stopped"], Mistaken: ["an error"]}[kind]


def test_a_callback_that_meets_the_end_is_no_error() -> None:
    assert run(Stopped, "stopped") == 0


def test_other_errors_are_not_hidden() -> None:
    with pytest.raises(RuntimeError, match="a real one"):
        run(Broken, "broken")


def test_a_mistake_in_a_callback_is_no_refused_parameter() -> None:
    with pytest.raises(ValueError, match="invalid literal"):
        run(Mistaken, "mistaken")
    assert not rclpy.ok()


@pytest.mark.parametrize(("given", "named"), [(["-p", "foo"], "'-p foo'"), (["--foo"], "--foo")])
def test_an_argument_that_ros_refuses_gives_one_line_and_1(
    given: list[str],
    named: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["node", "--ros-args", *given])
    assert run(Stopped, "node") == 1
    error = capsys.readouterr().err
    assert error.startswith("node: ")
    assert named in error
    assert error.count("\n") == 1


def test_refused_parameters_give_one_line_and_1(capsys: pytest.CaptureFixture[str]) -> None:
    def refuse() -> Node:
        raise ValueError("rate = -1: expected a positive number")

    assert run(refuse, "node") == 1
    assert capsys.readouterr().err == "node: rate = -1: expected a positive number\n"


@pytest.mark.parametrize(
    ("text", "sides"), [("4.27x2.13", (4.27, 2.13)), ("3X2", (3.0, 2.0)), ("0.1x100", (0.1, 100.0))]
)
def test_a_pool_is_its_two_sides(text, sides):
    assert pool_sides(text) == sides


@pytest.mark.parametrize(
    "text", ["", "3", "3x", "3x2x1", "0.05x2", "3x101", "nanx2", "infx2", "axb"]
)
def test_sides_that_no_pool_has_are_refused(text):
    with pytest.raises(ValueError, match="expected sides in metres"):
        pool_sides(text)


def walls(pool):
    """What a program with this FISH_POOL takes for its walls."""
    environment = {**os.environ, "FISH_POOL": pool}
    show = "from fish_node.pool import LENGTH, WIDTH; print(LENGTH, WIDTH)"
    return subprocess.run(
        [sys.executable, "-c", show], env=environment, capture_output=True, text=True, check=False
    )


def test_the_environment_sets_the_walls_and_a_wrong_one_ends_the_program_in_one_line():
    assert walls("3x2").stdout == "3.0 2.0\n"
    wrong = walls("three")
    assert wrong.returncode == 1
    assert wrong.stderr.startswith("FISH_POOL=three: expected sides in metres")
    assert wrong.stderr.count("\n") == 1


ENDLESS = """
from fish_node.nodes import start


class Endless:
    def destroy_node(self):
        while True:
            pass


class Spin:
    def init(self, arguments): ...

    def __call__(self, nodes): ...


start.END_S = 0.2
start.run(Endless, "endless", spin=Spin())
"""


def test_a_process_whose_middleware_never_ends_ends_itself_and_says_where_it_stood():
    ended = subprocess.run(
        [sys.executable, "-c", ENDLESS], capture_output=True, text=True, timeout=60
    )
    assert ended.returncode == 1
    assert "in destroy_node" in ended.stderr
