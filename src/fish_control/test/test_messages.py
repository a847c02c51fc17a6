# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages to values and back, by the conventions of ROS."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry

from fish_control.nodes.messages import (
    estimate_signs,
    motion_of,
    planar_covariance,
    seconds,
    to_quaternion,
    to_stamp,
    yaw_of,
)
from fish_control.watchdog import estimate_fault

# rows of a covariance (x, y, z, rotation about x, y, z): geometry_msgs/PoseWithCovariance
X, Y, YAW = 0, 1, 5


@pytest.mark.parametrize("yaw", [-3.1, -0.4, 0.0, 1.6, 3.1])
def test_a_heading_is_a_rotation_about_z(yaw):
    q = to_quaternion(yaw)
    assert (q.x, q.y, q.z, q.w) == pytest.approx((0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
    assert yaw_of(q) == pytest.approx(yaw)
    assert yaw_of(Quaternion(z=-q.z, w=-q.w)) == pytest.approx(yaw)  # the same rotation


def test_the_heading_of_a_body_that_rolls_and_pitches_is_where_its_nose_points_from_above():
    """Rotations about z by 0.7, then about y by 0.2, then about x by -0.3 rad, multiplied out as matrices."""
    roll, pitch, yaw = -0.3, 0.2, 0.7
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    q = Quaternion(
        w=cr * cp * cy + sr * sp * sy,
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
    )
    assert yaw_of(q) == pytest.approx(0.7)


@pytest.mark.parametrize("w", [0.0, 0.5, 2.0, math.nan])
def test_a_quaternion_that_is_none_has_no_heading(w):
    assert math.isnan(yaw_of(Quaternion(w=w)))


@pytest.mark.parametrize("time", [0.0, 12.25, 1.76e9 + 0.123456, 3.0 - 1e-10])
def test_stamps_keep_the_time(time):
    stamp = to_stamp(time)
    assert 0 <= stamp.nanosec < 1_000_000_000
    assert seconds(stamp) == pytest.approx(time, rel=1e-15, abs=1.1e-9)


def test_the_planar_part_of_a_covariance_is_of_x_y_and_yaw():
    planar = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]])
    full = np.full((6, 6), 99.0)
    full[np.ix_([X, Y, YAW], [X, Y, YAW])] = planar
    np.testing.assert_array_equal(planar_covariance(full.ravel()), planar)


def odometry():
    """At (1, 2) m on heading 0.5 rad with 0.3 m/s ahead, 0.1 m/s to the left and 0.7 rad/s, stamped 10.25 s."""
    message = Odometry()
    message.header.stamp = to_stamp(10.25)
    message.pose.pose.position.x, message.pose.pose.position.y = 1.0, 2.0
    message.pose.pose.orientation = to_quaternion(0.5)
    twist = message.twist.twist
    twist.linear.x, twist.linear.y, twist.angular.z = 0.3, 0.1, 0.7
    return message


def test_a_motion_is_pose_in_the_pool_and_velocity_of_the_body():
    assert motion_of(odometry()) == pytest.approx((1.0, 2.0, 0.5, 0.3, 0.1, 0.7))


@pytest.mark.parametrize("place", [X, Y, YAW])
def test_signs_of_an_estimate_hold_the_worst_variance_of_pose_and_of_twist(place):
    message = odometry()
    message.pose.covariance[7 * place], message.twist.covariance[7 * place] = 0.5, 0.25
    signs = estimate_signs(message, now=10.5)
    assert (signs.age, signs.finite) == (pytest.approx(0.25), True)
    assert (signs.pose_variance, signs.twist_variance) == (0.5, 0.25)


@pytest.mark.parametrize("place", [X, Y, YAW])
def test_a_variance_below_zero_says_that_nobody_measured_it(place):
    message = odometry()
    message.pose.covariance[7 * place] = message.twist.covariance[7 * place] = -1.0
    signs = estimate_signs(message, now=10.5)
    assert "camera lost" in estimate_fault(signs, timeout=1.0, largest_variance=1.0)
    message.pose.covariance[7 * place] = 0.01
    signs = estimate_signs(message, now=10.5)
    assert "IMU lost" in estimate_fault(signs, timeout=1.0, largest_variance=1.0)


@pytest.mark.parametrize("spoil", ["position", "velocity", "orientation"])
def test_an_estimate_with_a_value_that_is_no_number_is_not_finite(spoil):
    message = odometry()
    if spoil == "position":
        message.pose.pose.position.y = math.nan
    elif spoil == "velocity":
        message.twist.twist.angular.z = math.inf
    else:
        message.pose.pose.orientation = Quaternion(w=0.0)
    assert not estimate_signs(message, now=10.5).finite
