# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""control/target, control/twist, tracking/error, odometry/filtered -> joint_command, control/gains.

joint_command (100 Hz): rotor: position = phase of the oscillation (rad), velocity = phi_dot (rad/s); rudder:
position = alpha (rad). A command follows each new odometry at once, and while none comes a timer; in simulated time, which
waits for commands, they follow the timer alone. control/gains (50 Hz): [Kp, Ki, Kd] of steering and of speed, as the policy
of the weights file gives them. The commands are at rest until arming/state says armed. The watchdog pauses them on stale
or bad odometry, lost sensors and a stale target: they go to rest until all is well, and arming/pause says why. How long that
may last, the owner of the arming state decides. Of target, twist and error each has its own age; a twist or an error that no
fish can follow counts as none. Decisions are in Controller and Watchdog.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

from fish_control.controller import LONGEST_PERIOD, Controller, Reference
from fish_control.gains_file import read_gains_file, require_fit
from fish_control.latency import Latency
from fish_control.node_configs import ControllerConfig
from fish_control.nodes.messages import (
    ERROR,
    OK,
    WARN,
    CommandBytes,
    Reporter,
    estimate_signs,
    motion_of,
    seconds,
    yaw_of,
)
from fish_control.planner import FASTEST, SLOWEST
from fish_control.watchdog import LARGEST_MOTION, Health, Watchdog, loss
from fish_node.nodes.arming import ArmingListener
from fish_node.nodes.parameters import Changes
from fish_node.nodes.quick_messages import hear
from fish_node.nodes.robot_clock import timer_clock
from fish_node.nodes.spin import ByEvents
from fish_node.nodes.start import read_parameters, run

SETTABLE = ("gains_lowest", "gains_highest")
MISSED = 1.5  # periods of the command, after which it waits for odometry no more
FASTEST_TURN = 10.0  # rad/s, that can be wanted
LARGEST_ERROR = 100.0  # m, a larger cross-track error is a mistake
EARLY = 0.75  # periods of the command between the stamps of two that follow odometry; stamps jitter


class ControllerNode(Node):
    """Topics in and out of Controller."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "controller",
            namespace="fish",
            automatically_declare_parameters_from_overrides=True,
            **options,
        )
        self._config = config = read_parameters(self, ControllerConfig, SETTABLE)
        file = config.weights_file or installed_weights()
        policy = read_gains_file(file)
        require_fit(policy, file, 1.0 / config.rate_hz, config.lookahead, config.robot_hash)
        self._controller = Controller(policy)
        self._controller.limit_gains(config.gains_lowest, config.gains_highest)
        Changes(self, config, self._change)
        self._watchdog = Watchdog(config)
        self._odometry: Odometry | None = None
        self._odometry_time = math.nan
        self._target_time = self._twist_time = self._error_time = math.nan  # s, stamps
        self._wanted = Reference(0.0, 0.0, 0.0, 0.0)
        self._now = math.nan
        self._commanded = -math.inf  # s, stamp of the odometry that the last command followed
        self._due = 1.0 / config.rate_hz  # s since the last decision
        self._latency = Latency()
        self._said = ""
        self._paused = False
        self._create_interfaces()

    def _change(self, _: ControllerConfig, after: ControllerConfig) -> Callable[[], None]:
        """What takes over limits of the gains that were set at run time."""
        return lambda: self._controller.limit_gains(after.gains_lowest, after.gains_highest)

    def _create_interfaces(self) -> None:
        self._command = self.create_publisher(JointState, "joint_command", 10)
        self._written = CommandBytes()
        self._gains_message = gains_message()
        self._gains = self.create_publisher(Float64MultiArray, "control/gains", 10)
        self._pause = self.create_publisher(String, "arming/pause", 10)
        self._arming = ArmingListener(self)
        self._reporter = Reporter(self, self._command)
        hear(self, Odometry, "odometry/filtered", self._on_odometry, 10)
        hear(self, TwistStamped, "control/twist", self._on_twist, 10)
        hear(self, Vector3Stamped, "tracking/error", self._on_error, 10)
        hear(self, PoseStamped, "control/target", self._on_target, 10)
        self._waits = not self.get_parameter("use_sim_time").value  # for odometry
        self._period = 1.0 / self._config.command_rate_hz
        self._timer = self.create_timer(
            self._period * (MISSED if self._waits else 1.0), self._tick, clock=timer_clock(self)
        )
        self.create_timer(1.0, self._report, clock=timer_clock(self))

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry, self._odometry_time = message, seconds(message.header.stamp)
        signs = estimate_signs(message, self._odometry_time)
        if signs.plausible and not loss(
            signs, self._config.largest_variance
        ):  # the water is learned from it
            self._controller.observe(self._odometry_time, motion_of(message))
        now = self.get_clock().now()
        if self._waits and self._calls_for_a_command(now.nanoseconds * 1e-9):
            self._commanded = self._odometry_time
            self._timer.reset()
            self._step(now)

    def _calls_for_a_command(self, now: float) -> bool:
        """Whether the estimate is new and not one of several that waited: the timer then commands with the last of them."""
        age = now - self._odometry_time
        new = abs(self._odometry_time - self._commanded) > EARLY * self._period
        return new and age < MISSED * self._period

    def _on_twist(self, message: TwistStamped) -> None:
        speed, yaw_rate = message.twist.linear.x, message.twist.angular.z
        most = LARGEST_MOTION
        if abs(speed) <= most.surge and abs(yaw_rate) <= most.yaw_rate:
            self._twist_time = seconds(message.header.stamp)
            self._wanted = replace(
                self._wanted,
                speed=min(max(speed, SLOWEST), FASTEST) if speed > 0.0 else 0.0,
                yaw_rate=min(max(yaw_rate, -FASTEST_TURN), FASTEST_TURN),
            )

    def _on_error(self, message: Vector3Stamped) -> None:
        if abs(message.vector.x) <= LARGEST_ERROR:
            self._error_time = seconds(message.header.stamp)
            self._wanted = replace(self._wanted, cross_track_error=message.vector.x)

    def _on_target(self, message: PoseStamped) -> None:
        course = yaw_of(message.pose.orientation)
        if math.isfinite(course):
            self._wanted = replace(self._wanted, course=course)
            self._target_time = seconds(message.header.stamp)

    def _tick(self) -> None:
        """What the timer does."""
        self._step(self.get_clock().now())

    def _step(self, clock: Time) -> None:
        """One command; where a period of control has passed, one decision."""
        now = clock.nanoseconds * 1e-9
        dt = self._period if math.isnan(self._now) else now - self._now
        dt = min(max(dt, 0.0), LONGEST_PERIOD)
        self._now = now
        control_period = 1.0 / self._config.rate_hz
        self._due = min(self._due + dt, 1.5 * control_period)
        may_swim = self._watchdog.check(now, self._signs(now))
        self._say_pause()
        if not may_swim:
            self._controller.rest()
        elif self._wanted.speed <= 0.0:
            self._controller.glide(self._wanted.yaw_rate, dt)
        elif self._due > control_period - 0.5 * self._period:
            self._due -= control_period
            self._gains_message.data = list(self._controller.decide(self._wanted))
            self._gains.publish(self._gains_message)
        command = self._controller.command(dt)
        self._command.publish(self._written(clock.to_msg(), command))
        if may_swim:
            self._latency.add(now - self._odometry_time)
        if self._watchdog.state != self._said:
            self._report()

    def _say_pause(self) -> None:
        """Say why the commands are at rest, again and again, and once that they need not be any more."""
        fault = self._watchdog.fault
        if fault or self._paused:
            self._pause.publish(String(data=f"controller: {fault}" if fault else ""))
        self._paused = bool(fault)

    def _signs(self, now: float) -> Health:
        def age(stamp: float) -> float | None:
            return None if math.isnan(stamp) else now - stamp

        return Health(
            None if self._odometry is None else estimate_signs(self._odometry, now),
            age(self._target_time),
            age(self._twist_time),
            age(self._error_time),
            self._arming.forbids(self._config.arming_required),
        )

    def _report(self) -> None:
        self._said = self._watchdog.state
        level = {"swimming": OK, "waiting": WARN, "stopped": ERROR}[self._said]
        message = self._watchdog.reason
        if self._said == "swimming" and self._wanted.speed <= 0.0:
            message = "at rest: the wanted speed is 0"
        values: dict[str, object] = {"stops": self._watchdog.stops}
        delays = self._latency.percentiles()
        if delays is not None:
            values["latency_p50_ms"], values["latency_p99_ms"] = (
                f"{1e3 * delay:.1f}" for delay in delays
            )
        self._reporter.report(level, message, values)


def installed_weights() -> str:
    """The weights file that came with the package."""
    try:
        return f"{get_package_share_directory('fish_control')}/config/gains.safetensors"
    except (PackageNotFoundError, OSError):  # no workspace is sourced: run from the source tree
        return str(FilePath(__file__).parents[2] / "config" / "gains.safetensors")


def gains_message() -> Float64MultiArray:
    """Room for gains with a labelled layout: 2 controllers of 3 gains."""
    message = Float64MultiArray()
    message.layout.dim = [
        MultiArrayDimension(label="steering,speed", size=2, stride=6),
        MultiArrayDimension(label="Kp,Ki,Kd", size=3, stride=3),
    ]
    return message


def main() -> int:
    """Entry point."""
    return run(ControllerNode, "controller", spin=ByEvents())
