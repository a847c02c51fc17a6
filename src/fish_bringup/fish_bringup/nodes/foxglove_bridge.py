# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hands every topic of the robot to Foxglove, undecoded, over a websocket; needs the package foxglove-sdk."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from fish_bag.message_types import message_type
from fish_bag.nodes.raw_topics import from_profile, message_class, to_profile
from fish_bag.recorder_config import common_qos
from fish_bag.topic_map import message_types
from fish_report.printable import plain

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
        namespace = self._node.get_namespace()
        expected = message_types(namespace)
        for topic, _ in self._node.get_topic_names_and_types():
            if topic in self._known or not (
                topic.startswith(f"{namespace.rstrip('/')}/") or topic in self.SHARED
            ):
                continue
            offered = self._node.get_publishers_info_by_topic(topic)
            types: list[str] = sorted({info.topic_type for info in offered})
            if (
                types
            ):  # a topic that is only heard may still get a publisher of any quality of service
                own = expected.get(topic, "")
                self._pass_on(topic, own if own in types else types[0], offered)

    def _pass_on(self, topic: str, name: str, offered: Iterable[TopicEndpointInfo]) -> None:
        """One channel and one raw subscription; a topic that cannot be heard here is left out with a line."""
        self._known.add(topic)
        wanted = common_qos(
            [from_profile(info.qos_profile) for info in offered if info.topic_type == name]
        )
        try:
            schema = self._foxglove.Schema(
                name=name, encoding="ros2msg", data=message_type(name).definition
            )
            channel = self._foxglove.Channel(topic, schema=schema, message_encoding="cdr")
            self._node.create_subscription(
                message_class(name), topic, partial(_log, channel), to_profile(wanted), raw=True
            )
        except Exception as error:  # rclpy has errors of its own, as for a second type on a topic
            self._node.get_logger().warning(plain(f"{topic} ({name}) is not shown: {error}"))


def _log(channel: object, data: bytes) -> None:
    channel.log(data)  # type: ignore[attr-defined]
