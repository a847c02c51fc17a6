# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of the simulator node: every number in its field, with a value of its own."""

import math

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fish_sim.nodes import simulator_messages as messages
from fish_sim.sensors.imu import ImuSample
from fish_sim.sensors.overhead_camera import CameraPose
from fish_sim.sensors.settings import SensorSettings
from fish_sim.simulation import Truth

pytestmark = pytest.mark.ros
HEADER = Header(frame_id="frame")
TRUTH = Truth((1.0, 2.0, 2.5), (0.3, -0.2, 1.5), (0.1, -0.1, 0.2))


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
    msg = messages.odometry(HEADER, "fish_2/base_link", TRUTH)
    p, twist = msg.pose.pose.position, msg.twist.twist
    assert (p.x, p.y, p.z, heading(msg.pose.pose.orientation)) == pytest.approx(
        (1.0, 2.0, 0.0, 2.5)
    )
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.3, -0.2, 1.5)


def test_the_imu_keeps_axes_and_noise_apart() -> None:
    settings = SensorSettings(orientation_noise=0.1, gyro_noise=0.2, accelerometer_noise=0.3)
    sample = ImuSample(-0.7, np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))
    msg = messages.imu(HEADER, sample, settings)
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
    rotor, tail = messages.rotor(HEADER, (12.0, 80.0)), messages.tail(HEADER, TRUTH)
    assert (rotor.name, list(rotor.position), list(rotor.velocity)) == (["rotor"], [12.0], [80.0])
    assert (tail.name, list(tail.position)) == (["tail_1", "tail_2", "tail_3"], [0.1, -0.1, 0.2])
