# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node alone: what is said on three topics is one message with every joint."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from fish_description.nodes.joint_angles import JointAnglesNode

DOMAIN = 164
SPINS = 500  # turns of 20 ms that a message may take


@pytest.fixture
def spin() -> Iterator[Callable[[Callable[[], bool]], bool]]:
    """Both nodes in one executor; spin(done) turns it until done() or for SPINS turns."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    executor = SingleThreadedExecutor(context=context)
    nodes = [JointAnglesNode(context=context), Node("peer", namespace="fish", context=context)]
    for node in nodes:
        executor.add_node(node)

    def until(done: Callable[[], bool]) -> bool:
        return any(done() or executor.spin_once(0.02) or False for _ in range(SPINS))

    until.peer = nodes[1]  # type: ignore[attr-defined]
    yield until
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def test_three_topics_become_one_message(spin: Callable[[Callable[[], bool]], bool]) -> None:
    peer: Node = spin.peer  # type: ignore[attr-defined]
    heard: list[JointState] = []
    peer.create_subscription(JointState, "description/joint_states", heard.append, 10)
    encoder = peer.create_publisher(JointState, "joint_states", 10)
    command = peer.create_publisher(JointState, "joint_command", 10)
    tail = peer.create_publisher(JointState, "camera/tail", 10)

    def complete() -> bool:
        encoder.publish(JointState(name=["rotor"], position=[0.7], velocity=[3.0]))
        command.publish(JointState(name=["rotor", "rudder"], position=[2.0, 0.25]))
        tail.publish(JointState(name=["tail_1", "tail_2"], position=[-0.4, 0.1]))
        return bool(heard) and list(heard[-1].position) == [0.7, 0.25, -0.4, 0.1, 0.0]

    assert spin(complete)
    assert list(heard[-1].name) == ["rotor", "rudder", "tail_1", "tail_2", "tail_3"]
