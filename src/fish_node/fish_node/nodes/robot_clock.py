# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The clock by which a node drives devices: the monotonic clock of the computer, or with use_sim_time that of /clock."""

import time

from builtin_interfaces.msg import Time
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time as RosTime
from rosgraph_msgs.msg import Clock

from fish_node.simulated_time import SimulatedTime

TRIES = 3
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def timer_clock(node: Node) -> RosClock:
    """Of timers: simulated time, or a clock that is never set. One of the ROS clock rests for as long as that is set back."""
    simulated = node.get_parameter("use_sim_time").value
    return node.get_clock() if simulated else RosClock(clock_type=ClockType.STEADY_TIME)


class RobotClock:
    """Seconds for drivers and emulators, and their way to and from stamps; where /clock is set back, they run on.

    Attributes:
        simulated: whether time is that of /clock.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.simulated = bool(node.get_parameter("use_sim_time").value)
        self._time = SimulatedTime()
        if self.simulated:
            node.create_subscription(Clock, "/clock", self._on_clock, NEWEST)

    @property
    def runs(self) -> bool:
        """Whether there is a time: simulated time begins with the first message on /clock."""
        return self._time.runs or not self.simulated

    def now(self) -> float:
        """The time [s]."""
        return self._time.now() if self.simulated else time.monotonic()

    def wall(self, duration_s: float) -> float:
        """How long [s] to wait on the wall clock for a duration, before the time is looked at again."""
        return self._time.wall(duration_s) if self.simulated else duration_s

    def stamp(self, time_s: float) -> Time:
        """The stamp of a time of this clock.

        The monotonic and the ROS clock are read one after the other; of several tries the one that was interrupted least
        counts.
        """
        if self.simulated:
            return RosTime(nanoseconds=max(round(self.shared(time_s) * 1e9), 0)).to_msg()
        tries = []
        for _ in range(TRIES):
            before = time.monotonic()
            now_ns = (
                time.time_ns()
            )  # what the node's clock says; rclpy takes ten times as long to say it
            after = time.monotonic()
            tries.append((after - before, now_ns - round(0.5e9 * (before + after - 2.0 * time_s))))
        seconds, nanoseconds = divmod(min(tries)[1], 1_000_000_000)
        return Time(sec=seconds, nanosec=nanoseconds)

    def of(self, stamp: Time) -> float:
        """The time [s] on this clock of a stamp."""
        stamp_s = float(stamp.sec + 1e-9 * stamp.nanosec)
        if self.simulated:
            return self.own(stamp_s)
        age_s: float = self._node.get_clock().now().nanoseconds * 1e-9 - stamp_s
        return time.monotonic() - age_s

    def shared(self, time_s: float) -> float:
        """A time of this clock [s] on the one that all processes have: /clock, or the computer's monotonic clock."""
        return time_s - self._time.ahead_s

    def own(self, shared_s: float) -> float:
        """A time [s] of the clock that all processes have, on this one."""
        return shared_s + self._time.ahead_s

    def _on_clock(self, message: Clock) -> None:
        self._time.tick(message.clock.sec + 1e-9 * message.clock.nanosec)
