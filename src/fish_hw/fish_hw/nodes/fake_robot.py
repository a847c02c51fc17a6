# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `fake_robot`: the devices of a robot made of software, for the real drivers, with the simulator behind them.

The drivers find rotor, rudder, IMU and camera in the parameter `folder`. What rotor and rudder do goes to the simulator, and
what its IMU and camera sense comes back through the devices.

In:  fake/imu (sensor_msgs/Imu), fake/image/compressed (sensor_msgs/CompressedImage), fake/battery_state, fake/fault
     (std_msgs/String: the name of a fault, or `mend`); with use_sim_time also joint_command and camera/pose
Out: fake/joint_command (joint rotor: velocity [rad/s], joint rudder: position [rad]), /diagnostics; with use_sim_time also
     fake/lockstep (std_msgs/Header: how far rotor driver, controller and tracker are), for a simulator in lockstep
"""

import math
import sys
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState, CompressedImage, Imu, JointState
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool

from fish_hw.emulators.bno085 import Felt
from fish_hw.emulators.fake_robot import FakeRobot
from fish_hw.settings import FakeRobotSettings, RudderSettings
from fish_node.nodes.robot_clock import RobotClock
from fish_node.nodes.start import read_parameters, run

CAMERA_S = 0.2  # s that a pose may be late: the camera's own delay, two lost pictures, the tracker
NEWEST = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)


class FakeRobotNode(Node):
    """Messages of the simulator to and from the devices of FakeRobot."""

    def __init__(self) -> None:
        super().__init__(
            "fake_robot", namespace="fish", automatically_declare_parameters_from_overrides=True
        )
        settings = read_parameters(self, FakeRobotSettings)
        self._time = RobotClock(self)
        folder = Path(settings.folder)
        try:
            self._robot = FakeRobot(folder, RudderSettings(), settings.seed, self._time.now)
        except OSError as error:
            reason = error.strerror or error
            raise ValueError(
                f"folder {folder}: {reason}; give another one: -p folder:=FOLDER"
            ) from error
        self._steps: dict[str, float] = {}  # s, how far who is
        self._fault = "none"
        self._command = self.create_publisher(JointState, "fake/joint_command", 10)
        self._lockstep = self.create_publisher(Header, "fake/lockstep", 10)
        if self._time.simulated:
            self.create_subscription(JointState, "joint_command", self._on_command, 10)
            self.create_subscription(
                PoseWithCovarianceStamped, "camera/pose", self._on_camera, NEWEST
            )
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_subscription(Imu, "fake/imu", self._on_imu, NEWEST)
        self.create_subscription(CompressedImage, "fake/image/compressed", self._on_picture, NEWEST)
        self.create_subscription(BatteryState, "fake/battery_state", self._on_battery, 1)
        self.create_subscription(String, "fake/fault", self._on_fault, 10)
        self._arm = self.create_client(SetBool, "fake/arm")
        self.create_timer(1.0 / settings.rate_hz, self._move)
        self.create_timer(1.0, self._report)
        for driver, values in self._robot.parameters().items():
            said = ", ".join(f"{name}: {value}" for name, value in values.items())
            self.get_logger().info(f"{driver}.yaml of the real driver: {said}")

    def destroy_node(self) -> None:
        """Take the devices away, then the node."""
        self._robot.close()
        super().destroy_node()

    def _move(self) -> None:
        message = JointState(name=["rotor", "rudder"])
        message.header.stamp = self.get_clock().now().to_msg()
        message.velocity = [self._robot.rotor_speed(), 0.0]
        message.position = [self._robot.rotor.angle, self._robot.rudder_angle()]
        self._command.publish(message)
        self._say_step("rotor driver", self._robot.rotor.asked_s)

    def _on_command(self, message: JointState) -> None:
        self._say_step("controller", self._time.of(message.header.stamp))

    def _on_camera(self, message: PoseWithCovarianceStamped) -> None:
        self._say_step("tracker", self._time.of(message.header.stamp) + CAMERA_S)

    def _say_step(self, who: str, time_s: float) -> None:
        """How far somebody is, for a simulator in lockstep; the same again would be no news."""
        if self._time.simulated and time_s > self._steps.get(who, 0.0):
            self._steps[who] = time_s
            self._lockstep.publish(Header(frame_id=who, stamp=self._time.stamp(time_s)))

    def _on_imu(self, message: Imu) -> None:
        q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
        self._robot.imu.feel(
            Felt(
                self._time.of(message.header.stamp),
                (q.x, q.y, q.z, q.w),
                (w.x, w.y, w.z),
                (a.x, a.y, a.z),
            )
        )

    def _on_picture(self, message: CompressedImage) -> None:
        taken_s = self._time.shared(self._time.of(message.header.stamp))
        self._robot.camera.show(bytes(message.data), taken_s)

    def _on_battery(self, message: BatteryState) -> None:
        if math.isfinite(message.voltage):  # NaN says that nobody measured it
            self._robot.rotor.volts = float(message.voltage)

    def _on_fault(self, message: String) -> None:
        name = message.data
        if name == "mend":
            self._robot.mend()
        elif name in self._robot.faults:
            self._robot.faults[name]()
        else:
            known = ", ".join(("mend", *self._robot.faults))
            self.get_logger().error(f"unknown fault {name!r}; known: {known}")
            return
        self._fault = "none" if name == "mend" else name
        self.get_logger().info(f"fault: {name}")

    def _report(self) -> None:
        if self._arm.service_is_ready():  # the simulated fish follows whatever the devices do
            self._arm.call_async(SetBool.Request(data=True))
        status = DiagnosticStatus(
            name=self.get_fully_qualified_name().lstrip("/"), hardware_id="fake robot"
        )
        status.level, status.message = DiagnosticStatus.OK, f"fault: {self._fault}"
        rotor = self._robot.rotor
        values = {
            "commanded [rad/s]": f"{rotor.commanded:.1f}",
            "mode": rotor.mode,
            "timeouts": rotor.timeouts,
        }
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def main() -> int:
    """Entry point."""
    return run(FakeRobotNode, "fake_robot")


if __name__ == "__main__":
    sys.exit(main())
