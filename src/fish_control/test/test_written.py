# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the control nodes write as bytes: every number in its field, with a value of its own."""

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fish_control.controller import Command
from fish_control.estimate import Estimate
from fish_control.line_of_sight import Motion
from fish_control.nodes.messages import (
    CommandBytes,
    OdometryBytes,
    PlanBytes,
    planar_covariance,
    yaw_of,
)
from fish_control.paths import make_path
from fish_control.planner import Planner

pytestmark = pytest.mark.ros
STAMP = Time(sec=12, nanosec=250_000_000)


def covariance(first: float) -> np.ndarray:
    return np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]) * first


def estimate(shift: float) -> Estimate:
    pose, twist = np.array([1.0, 2.0, 0.5]) + shift, np.array([0.3, 0.1, 0.7]) + shift
    return Estimate(
        12.25 + shift, pose, twist, covariance(1.0), covariance(10.0), 0.0, False, False
    )


def test_an_estimate_is_odometry_with_its_covariances() -> None:
    written = OdometryBytes("pool", "fish_2/base_link")
    written(estimate(3.0))  # what one message held is not in the next
    message = deserialize_message(written(estimate(0.0)), Odometry)
    assert message.header == Header(stamp=STAMP, frame_id="pool")
    assert message.child_frame_id == "fish_2/base_link"
    position, twist = message.pose.pose.position, message.twist.twist
    assert (position.x, position.y, position.z) == (1.0, 2.0, 0.0)
    assert yaw_of(message.pose.pose.orientation) == pytest.approx(0.5)
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.3, 0.1, 0.7)
    for part, factor in ((message.pose, 1.0), (message.twist, 10.0)):
        np.testing.assert_array_equal(planar_covariance(part.covariance), covariance(factor))
        assert np.count_nonzero(part.covariance) == 9


def test_a_command_names_rotor_and_rudder() -> None:
    command = Command(phase=1.0, rotor_speed=80.0, alpha=-0.2)
    message = deserialize_message(CommandBytes()(STAMP, command), JointState)
    assert (message.header.stamp, message.name) == (STAMP, ["rotor", "rudder"])
    assert (list(message.position), list(message.velocity)) == ([1.0, -0.2], [80.0, 0.0])


def test_a_plan_is_a_target_a_twist_and_an_error() -> None:
    plan = Planner(make_path("circle", radius=0.5), 0.2).plan(
        Motion(0.4, 0.1, 1.2, 0.15, 0.02, 0.3)
    )
    written = PlanBytes("pool", "base_link")
    target = deserialize_message(written.target(STAMP, plan), PoseStamped)
    assert target.header == Header(stamp=STAMP, frame_id="pool")
    point = target.pose.position
    assert (point.x, point.y) == pytest.approx(tuple(plan.at.target))
    turned = yaw_of(target.pose.orientation) - plan.errors.course
    assert math.remainder(turned, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    twist = deserialize_message(written.twist(STAMP, plan), TwistStamped)
    assert twist.header == Header(stamp=STAMP, frame_id="base_link")
    assert (twist.twist.linear.x, twist.twist.angular.z) == (plan.speed, plan.yaw_rate)
    error = deserialize_message(written.error(STAMP, plan), Vector3Stamped).vector
    errors = plan.errors
    assert (error.x, error.y, error.z) == (errors.cross_track, errors.heading, errors.speed)
