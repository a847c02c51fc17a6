# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a camera's topic, for the commands that calibrate it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage, Image

from fish_vision.picture import PictureError, from_compressed, from_raw
from fish_vision.segmentation import Image as Picture

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class PictureSource(Node):
    """Hands every picture of a topic to a function; a topic that ends in /compressed is JPEG or PNG, any other one raw."""

    def __init__(
        self, topic: str, take: Callable[[Picture], None], context: Context | None = None
    ) -> None:
        super().__init__("calibrate", context=context)
        self._take = take
        self.refused = ""  # why the newest message was no picture
        kind = CompressedImage if topic.endswith("/compressed") else Image
        self.create_subscription(kind, topic, self._on_image, NEWEST)

    def _on_image(self, msg: CompressedImage | Image) -> None:
        try:
            if isinstance(msg, CompressedImage):
                picture = from_compressed(msg.data, None)
            else:
                size = msg.width, msg.height
                picture = from_raw(msg.data, msg.encoding, *size, msg.step, size)
        except PictureError as error:
            self.refused = str(error)
            return
        self._take(picture)


def collect(
    topic: str, accept: Callable[[Picture], bool], count: int, silence: float
) -> list[Picture]:
    """The first `count` pictures of a topic that are accepted.

    Raises:
        PictureError: no picture came for `silence` s.
    """
    pictures: list[Picture] = []
    came = 0

    def take(picture: Picture) -> None:
        nonlocal came
        came += 1
        if len(pictures) < count and accept(picture):
            pictures.append(picture)

    with _spinning(topic, take) as (node, executor):
        last, since = 0, time.monotonic()
        while len(pictures) < count:
            executor.spin_once(timeout_sec=0.2)
            now = time.monotonic()
            if came > last:
                last, since = came, now
            elif now - since > silence:
                why = node.refused or "is the camera's node running, in this ROS_DOMAIN_ID?"
                raise PictureError(f"{topic}: no picture for {silence:g} s ({why})")
    return pictures


@contextmanager
def _spinning(
    topic: str, take: Callable[[Picture], None]
) -> Iterator[tuple[PictureSource, SingleThreadedExecutor]]:
    """A node of its own context, so that the caller may have one as well."""
    context = Context()
    rclpy.init(context=context)
    node = PictureSource(topic, take, context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
