# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""joint_states, joint_command, camera/tail -> description/joint_states: every joint, for robot_state_publisher.

description/joint_states (sensor_msgs/JointState): rotor, rudder, tail_1 .. [rad]. What is measured, what is commanded and
what follows from the model is decided in JointAngles.
"""

from typing import Any

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from fish_description.joint_angles import JointAngles, JointAnglesConfig
from fish_node.nodes.start import read_parameters, run


class JointAnglesNode(Node):
    """Topics in and out of JointAngles."""

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "joint_angles",
            namespace="fish",
            automatically_declare_parameters_from_overrides=True,
            **options,
        )
        config = read_parameters(self, JointAnglesConfig)
        self._angles = JointAngles(config)
        self._publisher = self.create_publisher(JointState, "description/joint_states", 10)
        sensor = qos_profile_sensor_data
        self.create_subscription(JointState, "joint_states", self._on_encoder, sensor)
        self.create_subscription(JointState, "joint_command", self._on_command, sensor)
        self.create_subscription(JointState, "camera/tail", self._on_tail, sensor)
        self.create_timer(1.0 / config.rate_hz, self._publish)

    def _on_encoder(self, message: JointState) -> None:
        self._angles.encoder(message.name, message.position)

    def _on_command(self, message: JointState) -> None:
        self._angles.command(message.name, message.position)

    def _on_tail(self, message: JointState) -> None:
        self._angles.camera(message.name, message.position, self._now().nanoseconds * 1e-9)

    def _publish(self) -> None:
        now = self._now()
        angles = self._angles.angles(now.nanoseconds * 1e-9)
        message = JointState(name=list(angles), position=list(angles.values()))
        message.header.stamp = now.to_msg()
        self._publisher.publish(message)

    def _now(self) -> Any:
        return self.get_clock().now()


def main() -> int:
    """Spin the node."""
    return run(JointAnglesNode, "joint_angles")
