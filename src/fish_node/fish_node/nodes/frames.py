# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Frames on /tf_static and /tf, where tf2_msgs is installed: it is not among the wheels."""

from collections.abc import Sequence

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def publish_static_frame(
    node: Node,
    parent: str,
    child: str,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    rotation: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
) -> Publisher | None:
    """Say once where a frame is: position [m] and quaternion (x, y, z, w) of `child` in `parent`.

    Returns:
        The publisher, which the node must keep for those who come later; None without tf2_msgs.
    """
    if TFMessage is None:
        return None
    publisher = node.create_publisher(TFMessage, "/tf_static", LATCHED)
    message = static_transform(parent, child, position, rotation)
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(TFMessage(transforms=[message]))
    return publisher


def static_transform(
    parent: str, child: str, position: Sequence[float], rotation: Sequence[float]
) -> TransformStamped:
    """The transform as a message, without a stamp."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = map(float, position)
    turn.x, turn.y, turn.z, turn.w = map(float, rotation)
    return message


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
