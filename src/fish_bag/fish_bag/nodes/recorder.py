# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recorder: writes topics as they come, undecoded, to a rosbag2 recording (MCAP) that survives a kill.

In: every topic that the parameter `topics` selects, with the quality of service its publishers offer. Out:
the recording; /diagnostics. The bag's time is the moment of arrival on the recorder's wall clock, also
under use_sim_time: simulation time stands in the stamps and on /clock, and the reader relates the two. The middleware says
when a message arrived, so that a busy computer does not change it. What has arrived before the end is recorded.

Nobody waits for a recording, so that messages are taken all at once every LOOK_S: to wake up for each of them takes three times
the processor time.
"""

from __future__ import annotations

import signal
import sys
import time
from datetime import datetime
from itertools import islice
from operator import itemgetter

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.subscription import Subscription

from fish_bag.bag_metadata import Qos
from fish_bag.mcap_writer import McapRecording, Topic
from fish_bag.message_types import message_type
from fish_bag.nodes.raw_topics import from_profile, message_class, to_profile
from fish_bag.recorder_config import RecorderConfig, common_qos, is_selected
from fish_bag.topic_map import message_types
from fish_node.nodes.executor import Polled, take_all
from fish_node.nodes.start import read_parameters, run
from fish_report.errors import UserError
from fish_report.printable import plain

LOOK_S = 0.05  # s between two looks for messages; 1000 messages of a topic have room meanwhile


class RecorderNode(Node):
    """Finds topics, subscribes raw, hands bytes to a McapRecording."""

    def __init__(self) -> None:
        super().__init__(
            "recorder", namespace="fish", automatically_declare_parameters_from_overrides=True
        )
        self._config = read_parameters(self, RecorderConfig)
        directory = self._config.directory(datetime.now())
        custom = {"robot": self._config.robot} if self._config.robot else {}
        look_s = min(LOOK_S, self._config.chunk_s / 4)
        self.recording = McapRecording(directory, custom, self._config.chunk_s - look_s)
        self._subscriptions_of: dict[tuple[str, str], tuple[Subscription, Qos, Topic]] = {}
        self._refused: set[tuple[str, str]] = set()
        self._expected = message_types(self.get_namespace())
        self._patterns = [self._resolved(pattern) for pattern in self._config.topics]
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._polled = Polled()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(self._config.discovery_s, self._discover, clock=steady)
        self.create_timer(look_s, self._store_new, clock=steady)
        self.create_timer(self._config.chunk_s / 2, self._flush, clock=steady)
        self.create_timer(1.0, self._report, clock=steady)
        self._discover()
        self.get_logger().info(f"recording to {directory}")

    def _resolved(self, pattern: str) -> str:
        """An absolute name as this node's remapping rules have it: the clock of a second fish; patterns stay what they are."""
        name = pattern.startswith("/") and not set("*?[") & set(pattern)
        return str(self.resolve_topic_name(pattern)) if name else pattern

    def _discover(self) -> None:
        """Subscribe to selected topics that are new, or again where publishers offer something else."""
        self._refused = {key for key in self._refused if self._offered(*key)}
        for topic, types in self.get_topic_names_and_types():
            if is_selected(topic, self._patterns, self.get_namespace()):
                for msgtype in types:
                    self._follow(topic, msgtype)

    def _offered(self, topic: str, msgtype: str) -> list[Qos]:
        """What the publishers of a type on a topic offer."""
        return [
            from_profile(info.qos_profile)
            for info in self.get_publishers_info_by_topic(topic)
            if info.topic_type == msgtype
        ]

    def _follow(self, topic: str, msgtype: str) -> None:
        key, offered = (topic, msgtype), self._offered(topic, msgtype)
        if not offered or key in self._refused:
            return
        wanted = common_qos(offered)
        current = self._subscriptions_of.get(key)
        if current is not None and current[1] == wanted:
            return
        if current is not None:
            self._unsubscribe(key)
        if self._expected.get(topic) == msgtype:
            self._give_way(topic, msgtype)
        try:
            message, kind = message_class(msgtype), message_type(msgtype)
            subscription = self.create_subscription(
                message,
                topic,
                _not_called,
                to_profile(wanted),
                raw=True,
                callback_group=self._polled,
            )
        except (
            Exception
        ) as error:  # rclpy has errors of its own, for example for a second type on a topic
            others = [name for there, name in self._subscriptions_of if there == topic]
            reason = (
                f"a node hears one type on a topic, and {others[0]} came first" if others else error
            )
            self._refuse(key, " ".join(str(reason).split()))
            return
        channel = self.recording.add_topic(topic, kind, offered[0])
        self._subscriptions_of[key] = (subscription, wanted, channel)
        self.get_logger().info(plain(f"recording {topic} ({msgtype})"))

    def _unsubscribe(self, key: tuple[str, str]) -> None:
        self._store_new()
        self.destroy_subscription(self._subscriptions_of.pop(key)[0])

    def _refuse(self, key: tuple[str, str], reason: str) -> None:
        self._refused.add(key)
        self.get_logger().error(plain(f"{key[0]} ({key[1]}) is not recorded: {reason}"))

    def _give_way(self, topic: str, msgtype: str) -> None:
        """A node hears one type on a topic: where a foreign node came first, the robot's own type takes its place."""
        for key in [key for key in self._subscriptions_of if key[0] == topic]:
            self._unsubscribe(key)
            self._refuse(
                key, f"the robot publishes {msgtype} there; give the other node another topic"
            )

    def _store_new(self) -> None:
        """Record what arrived until now, in this order; what arrives meanwhile may wait for the next look.

        What had arrived is at most what the middleware keeps, also where it does not say when a message arrived.
        """
        end, found = time.time_ns(), []
        for subscription, kept, channel in self._subscriptions_of.values():
            for data, about in islice(take_all(subscription), kept.depth):
                arrived = about["received_timestamp"]  # 0: not said
                found.append((arrived or time.time_ns(), channel, data))
                if arrived > end:
                    break
        for arrived, channel, data in sorted(found, key=itemgetter(0)):
            self.recording.write(channel, arrived, data)

    def _flush(self) -> None:
        self.recording.flush_old(time.time_ns())

    def _report(self) -> None:
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name().lstrip("/"), hardware_id="recorder"
        )
        status.level, status.message = DiagnosticStatus.OK, "recording"
        if self._refused:
            status.level = DiagnosticStatus.WARN
            names = sorted(f"{topic} ({msgtype})" for topic, msgtype in self._refused)
            status.message = plain(f"not recorded: {', '.join(names)}")
        elif not self.recording.message_count:
            status.level, status.message = DiagnosticStatus.WARN, "nothing received yet"
        values = {
            "directory": self.recording.directory,
            "topics": len(self.recording.topics),
            "messages": self.recording.message_count,
            "bytes": self.recording.size,
        }
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def destroy_node(self) -> None:
        """Close the recording, then the node."""
        recording = self.recording
        if not recording.closed:  # as a full disk closes it
            self._store_new()
        recording.close()
        print(
            f"recorder: {recording.message_count} messages of {len(recording.topics)} topics, "
            f"{recording.size} bytes in {recording.directory}",
            flush=True,
        )
        super().destroy_node()


def _not_called(_: bytes) -> None:
    """The callback of a polled subscription."""


def main() -> int:
    """Record until SIGINT or SIGTERM; 1 and one line if the recording cannot be made or the disk is full."""
    # rclpy ends the spinning; a KeyboardInterrupt would also tear a record that is being written
    before = signal.signal(signal.SIGINT, lambda *_: None)
    try:
        return run(RecorderNode, "recorder")
    except (UserError, OSError) as error:
        print(f"recorder: {error}", file=sys.stderr)
        return 1
    finally:
        signal.signal(signal.SIGINT, before)


if __name__ == "__main__":
    sys.exit(main())
