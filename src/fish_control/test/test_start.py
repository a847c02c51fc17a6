"""How the nodes of this package start and stop."""

import pytest
import rclpy
from rclpy.node import Node

from fish_control.nodes.start import run

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def own_domain(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", "145")


class Mistaken(Node):
    """A node with a mistake in a callback."""

    def __init__(self) -> None:
        super().__init__("mistaken")
        self.create_timer(0.01, lambda: int("x"))


def refused() -> Node:
    raise ValueError("rate is -1,\nexpected a positive number")


def test_a_mistake_in_a_callback_is_no_refused_parameter():
    with pytest.raises(ValueError, match="invalid literal"):
        run(Mistaken, "mistaken")
    assert not rclpy.ok()


def test_what_cannot_start_says_why_in_one_line():
    with pytest.raises(SystemExit, match="^node: rate is -1, expected a positive number$"):
        run(refused, "node")
    assert not rclpy.ok()
