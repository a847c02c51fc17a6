# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a camera's topic for the commands: those that are accepted, and silence."""

import os
import threading
from collections.abc import Iterator

import numpy as np
import pytest

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

from fish_vision.nodes.picture_source import collect
from fish_vision.picture import PictureError, to_jpeg

pytestmark = pytest.mark.ros
DOMAIN = "175"  # above those that tests of other packages draw


class Camera:
    """Publishes grey pictures of 32 x 24 pixels, each 10 levels lighter, until it is closed."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node("camera", context=self._context)
        self._jpeg = self._node.create_publisher(CompressedImage, "/image/compressed", 1)
        self._raw = self._node.create_publisher(Image, "/image", 1)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def _publish(self) -> None:
        level = 0
        while not self._end.wait(0.05):
            level = (level + 10) % 250
            picture = np.full((24, 32, 3), level, np.uint8)
            self._jpeg.publish(CompressedImage(format="jpeg", data=to_jpeg(picture)))
            self._raw.publish(
                Image(height=24, width=32, encoding="bgr8", step=96, data=picture.tobytes())
            )

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> Iterator[Camera]:
    monkeypatch.setenv("ROS_DOMAIN_ID", DOMAIN)
    made = Camera()
    yield made
    made.close()


@pytest.mark.parametrize("topic", ["/image/compressed", "/image"])
def test_only_accepted_pictures_are_collected(camera: Camera, topic: str) -> None:
    pictures = collect(topic, lambda p: int(p[0, 0, 0]) % 20 > 5, count=3, silence=60.0)
    assert len(pictures) == 3
    assert all(p.shape == (24, 32, 3) and int(p[0, 0, 0]) % 20 > 5 for p in pictures)


def test_silence_is_an_error_that_names_the_topic(camera: Camera) -> None:
    with pytest.raises(PictureError, match=r"/nobody: no picture for 0\.5 s .*is the camera"):
        collect("/nobody", lambda _: True, count=1, silence=0.5)
