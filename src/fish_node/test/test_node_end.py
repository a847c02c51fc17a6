# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A node's end: what a signal brings about is no failure, what cannot start is one line, a mistake shows its traceback."""

from types import SimpleNamespace

import pytest
from rclpy._rclpy_pybind11 import RCLError

from fish_node.nodes import start


def run(monkeypatch, error, alive):
    """Run a node whose callback raises `error` and return what it did at its end; alive: no signal has come."""
    ended = []

    class Spin:
        def init(self, _):
            pass

        def __call__(self, _):
            raise error

    replaced = {
        "ok": lambda: alive,
        "try_shutdown": lambda: ended.append("shut down"),
    }
    monkeypatch.setattr(start, "rclpy", SimpleNamespace(**replaced))
    node = SimpleNamespace(destroy_node=lambda: ended.append("destroyed"))
    start.run(lambda: node, "controller", spin=Spin())
    return ended


@pytest.mark.parametrize(
    "error",
    [
        RCLError("Failed to publish: publisher's context is invalid"),
        RuntimeError("not ok"),
        ValueError("x"),
    ],
)
def test_what_a_signal_that_has_shut_the_context_down_brings_about_is_no_failure(
    monkeypatch, error
):
    ended = run(monkeypatch, error, alive=False)
    assert ended == ["destroyed", "shut down"]


@pytest.mark.parametrize("error", [RCLError("Failed to publish"), ValueError("invalid literal")])
def test_a_mistake_in_a_callback_is_no_refused_parameter(monkeypatch, error):
    with pytest.raises(type(error), match=str(error)):
        run(monkeypatch, error, alive=True)


def test_what_cannot_start_says_why(monkeypatch, capsys):
    def refuse():
        raise ValueError("speed is -1.0,\n expected at least 0")

    replaced = {"ok": lambda: True, "try_shutdown": lambda: None}
    monkeypatch.setattr(start, "rclpy", SimpleNamespace(**replaced))
    assert start.run(refuse, "planner", spin=SimpleNamespace(init=lambda _: None)) == 1
    assert capsys.readouterr().err == "planner: speed is -1.0, expected at least 0\n"


def test_a_signal_that_shuts_the_context_down_at_the_same_moment_is_no_failure(monkeypatch):
    """rclpy looks whether it is still there, and then shuts it down."""
    tries = []

    def try_shutdown():
        tries.append(None)
        if len(tries) == 1:
            raise RCLError("failed to shutdown: rcl_shutdown already called on the given context")

    monkeypatch.setattr(start, "rclpy", SimpleNamespace(try_shutdown=try_shutdown))
    start.shut_down()
    assert len(tries) == 2  # the second finds it gone, and forgets it
