# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replayer: publishes a recording's messages undecoded, at the times at which they had arrived.

Out: the recorded topics that `topics` selects and `exclude` leaves, with the quality of service they were
recorded with (ROS remapping renames them: --ros-args -r /fish/imu/data:=/other); /clock with bag time
unless the recording has a /clock of its own; /diagnostics. Service ~/pause (std_srvs/SetBool). Ends with 0
after the last message.
"""

from __future__ import annotations

import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import SetBool

from fish_bag.bag import RawTopic
from fish_bag.bag_metadata import parse_qos
from fish_bag.nodes.raw_topics import message_class, to_profile
from fish_bag.playback import Playback, PlaybackClock, ReplayerConfig
from fish_bag.problem import RecordingError
from fish_node.nodes.start import read_parameters, run
from fish_report.errors import UserError
from fish_report.printable import plain

LINGER = Duration(seconds=2)  # for the last messages to be received before the node ends


class ReplayerNode(Node):
    """Publishes what a Playback says is due."""

    def __init__(self) -> None:
        super().__init__(
            "replayer", namespace="fish", automatically_declare_parameters_from_overrides=True
        )
        config = read_parameters(self, ReplayerConfig)
        self._playback = Playback(config, self.get_namespace())
        self._loop, self._sent, self._rounds, self._latest_ns = config.loop, 0, 0, 0
        self._publishers_of: dict[tuple[str, str], Publisher] = {}
        for raw in self._playback.topics:
            self._announce(raw)
        if not self._publishers_of:
            raise RecordingError(f"{config.recording}: none of its topics can be published")
        recorded_clock = any(topic == "/clock" for topic, _ in self._publishers_of)
        self._tick_ns = 0 if recorded_clock or not config.clock_hz else round(1e9 / config.clock_hz)
        self._ticks = self.create_publisher(ClockMessage, "/clock", 10) if self._tick_ns else None
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_service(SetBool, "~/pause", self._on_pause)
        delay_ns = round(config.start_delay_s * 1e9)
        start = self._playback.start_ns
        self._time = PlaybackClock(
            config.rate, start, time.monotonic_ns() + delay_ns, config.paused
        )
        self._messages = self._playback.messages()
        self._next: tuple[RawTopic, int, bytes] | None = next(self._messages)
        self._next_tick = start
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._due = self.create_timer(config.start_delay_s or 1e-3, self._publish_due, clock=steady)
        self.create_timer(1.0, self._report, clock=steady)
        self.get_logger().info(f"replaying {config.recording} at rate {config.rate:g}")

    def _announce(self, raw: RawTopic) -> None:
        """Create the publisher of a topic; a topic that cannot be published here is left out."""
        try:
            if raw.stored.serialization != "cdr":
                raise RecordingError(f"it is serialised as {raw.stored.serialization!r}")
            self._publishers_of[raw.topic, raw.type] = self.create_publisher(
                message_class(raw.type), raw.topic, to_profile(parse_qos(raw.stored.qos))
            )
        except Exception as error:  # rclpy has errors of its own for names and types it refuses
            self.get_logger().warning(plain(f"{raw.topic} is not replayed: {error}"))

    def _publish_due(self) -> None:
        """Publish what is due and arm the timer for what comes next."""
        self._due.cancel()
        if self._time.paused:
            return
        now = time.monotonic_ns()
        bag_now = self._time.bag_time(now)
        while self._next is not None and self._next[1] <= bag_now:
            topic, due, raw = self._next
            self._tick(due)
            publisher = self._publishers_of.get((topic.topic, topic.type))
            if publisher is not None:
                publisher.publish(raw)
                self._sent += 1
                self._latest_ns = max(self._latest_ns, bag_now - due)
            self._next = next(self._messages, None)
        if self._next is None:
            self._end()
            return
        self._tick(bag_now)
        upcoming = min(self._next[1], self._next_tick) if self._tick_ns else self._next[1]
        self._due.timer_period_ns = max(1, self._time.wait(upcoming, time.monotonic_ns()))
        self._due.reset()

    def _tick(self, bag_ns: int) -> None:
        """Publish /clock for every step up to bag_ns (one message if several are due)."""
        if self._ticks is None or bag_ns < self._next_tick:
            return
        self._next_tick += ((bag_ns - self._next_tick) // self._tick_ns + 1) * self._tick_ns
        stamp = Time(nanoseconds=self._next_tick - self._tick_ns).to_msg()
        self._ticks.publish(ClockMessage(clock=stamp))

    def _end(self) -> None:
        """Start again, or let the last messages go out and stop."""
        self._rounds += 1
        if self._loop:
            start, rest = self._playback.start_ns, self._playback.rest_ns
            self._messages = self._playback.messages()
            self._next, self._next_tick = next(self._messages), start
            self._time.restart(start, time.monotonic_ns() + rest)
            self._due.timer_period_ns = max(1, rest)
            self._due.reset()
            return
        for publisher in self._publishers_of.values():
            publisher.wait_for_all_acked(LINGER)
        print(
            f"replayer: {self._sent} messages, latest {self._latest_ns * 1e-6:.1f} ms after its time",
            flush=True,
        )
        rclpy.shutdown()

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._time.set_paused(request.data, time.monotonic_ns())
        self._due.timer_period_ns = 1
        self._due.reset()
        response.success, response.message = True, "paused" if request.data else "running"
        return response

    def _report(self) -> None:
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name().lstrip("/"), hardware_id="replayer"
        )
        status.level = DiagnosticStatus.OK
        status.message = "paused" if self._time.paused else "replaying"
        elapsed = (self._time.bag_time(time.monotonic_ns()) - self._playback.start_ns) * 1e-9
        values = {"bag time (s)": f"{elapsed:.3f}", "messages": self._sent, "rounds": self._rounds}
        values["latest (ms)"] = f"{self._latest_ns * 1e-6:.1f}"
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def main() -> int:
    """Replay to the end, or until SIGINT or SIGTERM; 1 and one line if the recording cannot be replayed."""
    try:
        return run(ReplayerNode, "replayer")
    except UserError as error:
        print(f"replayer: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
