# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""odometry/filtered -> joint_command: runs an open-loop program, for recordings that tell what a robot lacks.

joint_command (100 Hz): rotor: position = phase of the oscillation (rad), velocity = phi_dot (rad/s); rudder:
position = alpha (rad). It takes the place of planner and controller, begins when the estimate has come and the robot is
armed (arming/state), and ends by itself. The guard looks at the estimate only to stop: before a wall, and when the estimate
is lost, which also disarms (arming/disarm). Decisions are in Exciter and Excitation.
"""

import math
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from fish_control.controller import LONGEST_PERIOD
from fish_control.excitation import Excitation, read_program
from fish_control.exciter import Exciter, Sight, State
from fish_control.node_configs import ExciterConfig
from fish_control.nodes.messages import (
    ERROR,
    OK,
    WARN,
    CommandBytes,
    Reporter,
    estimate_signs,
    motion_of,
)
from fish_node.nodes.arming import ArmingListener
from fish_node.nodes.robot_clock import timer_clock
from fish_node.nodes.start import read_parameters, run

RESENT = 1000  # commands kept for a recorder that lags on a busy computer: 10 s
LEVELS: dict[State, bytes] = {
    "waiting": WARN,
    "before a wall": WARN,
    "lost": ERROR,
    "disarmed": ERROR,
}  # the others are well


class ExciterNode(Node):
    """Topics in and out of Exciter."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "exciter",
            namespace="fish",
            automatically_declare_parameters_from_overrides=True,
            **options,
        )
        config = read_parameters(self, ExciterConfig)
        if not config.program_file:
            raise ValueError(
                "program_file is empty, expected a file with a program: a diagnosis.json has one"
            )
        program = read_program(Path(config.program_file))
        self._excitation = Excitation(program, config.begin, config.end or math.inf)
        self._exciter = Exciter(config, self._excitation)
        self._odometry: Odometry | None = None
        self._now = math.nan
        self._said: State | None = None
        self._command = self.create_publisher(JointState, "joint_command", RESENT)
        self._written = CommandBytes()
        self._disarm = self.create_publisher(String, "arming/disarm", 10)
        self._arming, self._arming_required = ArmingListener(self), config.arming_required
        self._reporter = Reporter(self, self._command)
        self.create_subscription(Odometry, "odometry/filtered", self._on_odometry, 10)
        self.create_timer(1.0 / config.command_rate_hz, self._tick, clock=timer_clock(self))
        self.create_timer(1.0, self._report, clock=timer_clock(self))

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry = message

    def _tick(self) -> None:
        clock = self.get_clock().now()
        now = clock.nanoseconds * 1e-9
        dt = 0.0 if math.isnan(self._now) else min(max(now - self._now, 0.0), LONGEST_PERIOD)
        self._now = now
        disarmed = self._arming.forbids(self._arming_required)
        command = self._exciter.command(now, dt, self._sight(now), disarmed)
        self._command.publish(self._written(clock.to_msg(), command))
        if self._exciter.state != self._said:
            if self._exciter.state == "lost":
                self._disarm.publish(String(data=f"exciter: {self._exciter.reason}"))
            self._report()

    def _sight(self, now: float) -> Sight | None:
        message = self._odometry
        return None if message is None else Sight(motion_of(message), estimate_signs(message, now))

    def _report(self) -> None:
        self._said = self._exciter.state
        values: dict[str, object] = {
            "time_s": f"{self._excitation.time:.2f}",
            "end_s": f"{self._excitation.end:.2f}",
            "over": str(self._excitation.over).lower(),
        }
        self._reporter.report(LEVELS.get(self._said, OK), self._exciter.reason, values)


def main() -> int:
    """Entry point."""
    return run(ExciterNode, "exciter")
