"""A node's end: what a signal brings about is no failure, everything else is one line."""

from types import SimpleNamespace

import pytest
from rclpy._rclpy_pybind11 import RCLError

from fish_control.nodes import start


@pytest.mark.parametrize("alive", [False, True])
def test_publishing_after_a_signal_has_shut_the_context_down_is_no_failure(monkeypatch, alive):
    def spin(_):
        raise RCLError("Failed to publish: publisher's context is invalid")

    replaced = {"init": lambda: None, "spin": spin, "ok": lambda: alive, "try_shutdown": lambda: None}
    monkeypatch.setattr(start, "rclpy", SimpleNamespace(**replaced))
    node = SimpleNamespace(destroy_node=lambda: None)
    if not alive:
        start.run(lambda: node, "controller")
        return
    with pytest.raises(SystemExit, match="controller: Failed to publish"):
        start.run(lambda: node, "controller")


def test_what_cannot_start_says_why(monkeypatch):
    def refuse():
        raise ValueError("speed is -1.0,\n expected at least 0")

    replaced = {"init": lambda: None, "ok": lambda: False, "try_shutdown": lambda: None}
    monkeypatch.setattr(start, "rclpy", SimpleNamespace(**replaced))
    with pytest.raises(SystemExit, match="planner: speed is -1.0, expected at least 0"):
        start.run(refuse, "planner")
