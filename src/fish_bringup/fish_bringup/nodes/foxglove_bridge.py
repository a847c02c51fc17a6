# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hands every topic of the robot to Foxglove, undecoded, over a websocket; needs the package foxglove-sdk."""

from __future__ import annotations

from functools import partial

from rclpy.node import Node

from fish_bag.message_types import message_type
from fish_bag.nodes.raw_topics import from_profile, message_class, to_profile
from fish_bag.problem import RecordingError
from fish_bag.recorder_config import common_qos

LOOK_PERIOD = 1.0  # s between looks for new topics


class FoxgloveBridge:
    """A websocket server with a channel for each topic of the node's namespace and each of the shared ones.

    Args:
        node: subscribes.
        address, port: of the websocket.

    Raises:
        ValueError: the package is missing, or the port is in use; the text says what to do.
    """

    SHARED = ("/tf", "/tf_static", "/diagnostics")

    def __init__(self, node: Node, address: str, port: int) -> None:
        try:
            import foxglove
        except ImportError as error:
            raise ValueError(
                "no websocket for Foxglove: pip install foxglove-sdk, or say foxglove_port:=0"
            ) from error
        self._foxglove, self._node = foxglove, node
        foxglove.set_log_level("ERROR")
        try:
            self._server = foxglove.start_server(name="robot fish", host=address, port=port)
        except (RuntimeError, OSError) as error:
            raise ValueError(
                f"no websocket for Foxglove on {address}:{port}: {error}; give another foxglove_port"
            ) from error
        self._known: set[str] = set()
        node.create_timer(LOOK_PERIOD, self._look)

    def close(self) -> None:
        """Give the port back."""
        self._server.stop()

    def _look(self) -> None:
        prefix = f"{self._node.get_namespace().rstrip('/')}/"
        for topic, types in self._node.get_topic_names_and_types():
            if topic not in self._known and (topic.startswith(prefix) or topic in self.SHARED):
                self._pass_on(topic, types[0])

    def _pass_on(self, topic: str, name: str) -> None:
        """One channel and one raw subscription; a type that is not installed here is left out with a line."""
        self._known.add(topic)
        try:
            kind, definition = message_class(name), message_type(name).definition
        except RecordingError as error:
            self._node.get_logger().warning(f"{topic} is not shown: {error}")
            return
        schema = self._foxglove.Schema(name=name, encoding="ros2msg", data=definition)
        channel = self._foxglove.Channel(topic, schema=schema, message_encoding="cdr")
        offered = self._node.get_publishers_info_by_topic(topic)
        wanted = common_qos([from_profile(info.qos_profile) for info in offered])
        self._node.create_subscription(
            kind, topic, partial(_log, channel), to_profile(wanted), raw=True
        )


def _log(channel: object, data: bytes) -> None:
    channel.log(data)  # type: ignore[attr-defined]
