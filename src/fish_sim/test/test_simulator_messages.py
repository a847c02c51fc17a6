# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of the simulator node: every number in its field, with a value of its own."""

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Header

from fish_sim.nodes import simulator_messages as messages
from fish_sim.sensors.onboard import ImuSample
from fish_sim.sensors.overhead_camera import CameraPose
from fish_sim.sensors.settings import SensorSettings
from fish_sim.simulation import Truth

pytestmark = pytest.mark.ros
HEADER = Header(frame_id="frame")
STAMP = Time(sec=12, nanosec=345)
FRAMES = "pool", "fish_2/base_link", "fish_2/imu_link"
TRUTH = Truth((1.0, 2.0, 2.5), (0.3, -0.2, 1.5), (0.1, -0.1, 0.2))


def written(settings: SensorSettings | None = None) -> messages.PeriodMessages:
    return messages.PeriodMessages(FRAMES, 3, settings or SensorSettings())


def heading(orientation) -> float:
    assert orientation.x == orientation.y == 0.0
    return 2.0 * math.atan2(orientation.z, orientation.w)


@pytest.mark.parametrize(
    "names", [["rotor", "rudder"], ["rudder", "rotor"], ["other", "rudder", "rotor"]]
)
def test_a_command_is_read_by_name(names: list[str]) -> None:
    positions, speeds = {"rudder": 0.4}, {"rotor": 90.0}
    msg = JointState(name=names)
    msg.position = [positions.get(name, 7.0) for name in names]
    msg.velocity = [speeds.get(name, 7.0) for name in names]
    assert messages.command(msg) == (90.0, 0.4)


def test_odometry_is_the_truth() -> None:
    msg = deserialize_message(written().odometry(STAMP, TRUTH), Odometry)
    assert msg.header == Header(stamp=STAMP, frame_id="pool")
    assert msg.child_frame_id == "fish_2/base_link"
    assert not msg.pose.covariance.any()
    p, twist = msg.pose.pose.position, msg.twist.twist
    assert (p.x, p.y, p.z, heading(msg.pose.pose.orientation)) == pytest.approx(
        (1.0, 2.0, 0.0, 2.5)
    )
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.3, -0.2, 1.5)


def test_the_imu_keeps_axes_and_noise_apart() -> None:
    settings = SensorSettings(orientation_noise=0.1, gyro_noise=0.2, accelerometer_noise=0.3)
    sample = ImuSample(-0.7, np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))
    msg = deserialize_message(written(settings).imu(STAMP, sample), Imu)
    assert msg.header == Header(stamp=STAMP, frame_id="fish_2/imu_link")
    w, a = msg.angular_velocity, msg.linear_acceleration
    assert heading(msg.orientation) == pytest.approx(-0.7)
    assert (w.x, w.y, w.z, a.x, a.y, a.z) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    for covariance, std in (
        (msg.orientation_covariance, 0.1),
        (msg.angular_velocity_covariance, 0.2),
        (msg.linear_acceleration_covariance, 0.3),
    ):
        np.testing.assert_allclose(covariance.reshape(3, 3), std**2 * np.eye(3))


def test_a_camera_pose_carries_its_noise_in_x_y_and_yaw() -> None:
    settings = SensorSettings(camera_position_noise=0.01, camera_heading_noise=0.2)
    msg = messages.camera_pose(HEADER, CameraPose(1.0, 1.05, -0.5, 0.25, 3.0), settings)
    p = msg.pose.pose.position
    assert (p.x, p.y, heading(msg.pose.pose.orientation)) == pytest.approx((-0.5, 0.25, 3.0))
    expected = np.diag([0.01**2, 0.01**2, 0.0, 0.0, 0.0, 0.2**2])
    np.testing.assert_allclose(msg.pose.covariance.reshape(6, 6), expected)


def test_encoder_and_tail_are_named_joints() -> None:
    out = written()
    rotor = deserialize_message(out.rotor(STAMP, (12.0, 80.0)), JointState)
    tail = deserialize_message(out.tail(STAMP, TRUTH), JointState)
    assert rotor.header == tail.header == Header(stamp=STAMP, frame_id="fish_2/base_link")
    assert (rotor.name, list(rotor.position), list(rotor.velocity)) == (["rotor"], [12.0], [80.0])
    assert (tail.name, list(tail.position)) == (["tail_1", "tail_2", "tail_3"], [0.1, -0.1, 0.2])


def test_the_clock_is_the_stamp_and_each_message_has_its_own() -> None:
    out = written()
    first, second = out.clock(STAMP), out.clock(Time(sec=13, nanosec=0))
    assert deserialize_message(first, Clock).clock == STAMP
    assert deserialize_message(second, Clock).clock == Time(sec=13, nanosec=0)
