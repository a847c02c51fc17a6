# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How a node says how it is."""

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.publisher import Publisher

from fish_control.nodes.messages import WARN, diagnostics
from fish_node.nodes.status_log import StatusLog
from fish_node.rivals import Rivals


class Reporter:
    """A node's status: on /diagnostics whenever it is reported, on the console when it changes.

    Args:
        node: whose status it is.
        output: what no other node may publish.
    """

    def __init__(self, node: Node, output: Publisher) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._log = StatusLog(node.get_logger())
        self._rivals = Rivals(output.topic_name, node.count_publishers, node.get_logger().warning)

    def report(self, level: bytes, message: str, values: dict[str, object]) -> None:
        """Say it."""
        self._log.say(level, message)
        if warning := self._rivals.warning():
            level, message = max(level, WARN), f"{message}; {warning}"
        now, name = self._node.get_clock().now().to_msg(), self._node.get_fully_qualified_name()
        self._publisher.publish(diagnostics(now, name, level, message, values))
