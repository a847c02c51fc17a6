# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Moving frames on /tf, where tf2_msgs is installed: it is not among the wheels."""

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class FrameBroadcaster:
    """A node's moving frames on /tf; without tf2_msgs it says nothing.

    Attributes:
        heard: whether there is a /tf to say them on.
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(TFMessage, "/tf", 10) if TFMessage else None
        self.heard = self._publisher is not None

    def send(self, transform: TransformStamped) -> None:
        """Publish one transform."""
        if self._publisher is not None:
            self._publisher.publish(TFMessage(transforms=[transform]))
