"""odometry/filtered -> joint_command: runs an open-loop program, for recordings that tell what a robot lacks.

joint_command (100 Hz): rotor: position = phase of the oscillation (rad), velocity = phi_dot (rad/s); rudder:
position = alpha (rad). It takes the place of planner and controller, begins when the estimate has come and ends
by itself. The guard looks at the estimate only to stop: before a wall, and when the estimate is lost. Decisions
are in Excitation and wall_guard.
"""

import math
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState

from fish_control.controller import LONGEST_PERIOD, Command
from fish_control.excitation import LIMITS, Excitation, read_program
from fish_control.node_configs import ExciterConfig
from fish_control.nodes.messages import (
    ERROR,
    OK,
    WARN,
    diagnostics,
    joint_command,
    motion_of,
    planar_covariance,
    seconds,
)
from fish_control.nodes.start import read_parameters, run
from fish_control.planner import motion_is_finite
from fish_control.wall_guard import heads_for_a_wall, stopping_rudder

AT_REST = Command(0.0, 0.0, 0.0)


class ExciterNode(Node):
    """Topics in and out of Excitation."""

    def __init__(self, **options: Any) -> None:
        super().__init__("exciter", namespace="fish", **options)
        self._config = config = read_parameters(self, ExciterConfig)
        if not config.program_file:
            raise ValueError(
                "program_file is empty, expected a file with a program: a diagnosis.json has one"
            )
        program = read_program(Path(config.program_file))
        self._excitation = Excitation(program, config.begin, config.end or math.inf)
        self._odometry: Odometry | None = None
        self._now = self._first = math.nan
        self._level, self._said = WARN, "waiting for odometry" if config.guard else "at rest"
        self._command = self.create_publisher(JointState, "joint_command", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_subscription(Odometry, "odometry/filtered", self._on_odometry, 10)
        self.create_timer(1.0 / config.command_rate_hz, self._tick)
        self.create_timer(1.0, self._report)

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry = message

    def _tick(self) -> None:
        clock = self.get_clock().now()
        now = clock.nanoseconds * 1e-9
        dt = 0.0 if math.isnan(self._now) else min(max(now - self._now, 0.0), LONGEST_PERIOD)
        self._now = now
        command = self._excitation.command(dt) if self._may_move(now) else AT_REST
        self._command.publish(joint_command(clock.to_msg(), command))

    def _may_move(self, now: float) -> bool:
        """False before the begin; afterwards always, for a stopped program brings rotor and rudder to rest."""
        if self._config.guard and self._odometry is None:
            return False
        if math.isnan(self._first):
            self._first = now
            self._say(OK, "at rest")
        if now - self._first < self._config.rest:
            return False
        if self._said == "at rest":
            self._say(OK, "swimming")
        if not self._excitation.over:
            self._look(now)
        if self._excitation.over and self._said == "swimming":
            self._say(OK, f"ended at {self._excitation.time:.1f} s, as programmed")
        return True

    def _look(self, now: float) -> None:
        """Stop where the guard finds a reason."""
        if not self._config.guard or self._odometry is None:
            return
        config, message, time = self._config, self._odometry, self._excitation.time
        motion, age = motion_of(message), now - seconds(message.header.stamp)
        pose, twist = planar_covariance(message.pose.covariance), planar_covariance(message.twist.covariance)
        if not motion_is_finite(motion):
            self._stop(ERROR, f"stopped at {time:.1f} s: odometry is not finite")
        elif age > config.odometry_timeout:
            self._stop(ERROR, f"stopped at {time:.1f} s: odometry is {age:.2f} s old")
        elif not max(pose.diagonal().max(), twist.diagonal().max()) <= config.largest_variance:
            self._stop(ERROR, f"stopped at {time:.1f} s: fusion does not vouch for the estimate")
        elif heads_for_a_wall(motion, config.horizon, config.margin):
            where = f"({motion.x:.2f}, {motion.y:.2f}) m"
            self._stop(
                WARN,
                f"stopped at {time:.1f} s before a wall, at {where}",
                stopping_rudder(motion, LIMITS.rudder_range),
            )

    def _stop(self, level: bytes, reason: str, rudder: float = 0.0) -> None:
        self._excitation.stop(rudder)
        self._say(level, reason)

    def _say(self, level: bytes, text: str) -> None:
        self._level, self._said = level, text
        self._report()

    def _report(self) -> None:
        now = self.get_clock().now().to_msg()
        values: dict[str, object] = {
            "time_s": f"{self._excitation.time:.2f}",
            "end_s": f"{self._excitation.end:.2f}",
            "over": str(self._excitation.over).lower(),
        }
        name = self.get_fully_qualified_name()
        self._diagnostics.publish(diagnostics(now, name, self._level, self._said, values))


def main() -> None:
    """Entry point."""
    run(ExciterNode, "exciter")
