# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages to values and back."""

import math
from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import Imu

from fish_control.line_of_sight import Motion
from fish_control.planner import motion_is_finite
from fish_control.watchdog import EstimateHealth
from fish_node.arming import largest_of

NOT_MEASURED = -1.0  # first covariance of what an Imu message does not measure
PLANAR = (0, 1, 5)  # x, y and rotation about z among the six of a ROS covariance
PLANAR_BLOCK = np.array([6 * i + k for i in PLANAR for k in PLANAR])  # places among its 36 numbers
planar_block = itemgetter(*PLANAR_BLOCK.tolist())  # their numbers
planar_variances = itemgetter(*(7 * k for k in PLANAR))  # and those of the diagonal

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def seconds(stamp: Time) -> float:
    """A stamp [s]."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def to_stamp(time: float) -> Time:
    """Time [s] as a stamp."""
    sec = math.floor(time)
    return Time(sec=sec, nanosec=min(round((time - sec) * 1e9), 999_999_999))


def yaw_of(q: Quaternion) -> float:
    """Rotation about z [rad]; NaN if the quaternion is not one."""
    norm = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if not 0.5 < norm < 2.0:
        return math.nan
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), norm - 2.0 * (q.y * q.y + q.z * q.z))


def inertial_values(
    message: Imu,
) -> tuple[float | None, float | None, float | None, float | None, float | None]:
    """Yaw rate [rad/s], forward and left specific force [m/s^2], yaw [rad] and its deviation [rad].

    None: not measured, which a first covariance of -1 says, or where a quaternion is none; a deviation that is not given.
    """
    rate = forward = left = yaw = std = None
    if message.angular_velocity_covariance[0] != NOT_MEASURED:
        rate = message.angular_velocity.z
    if message.linear_acceleration_covariance[0] != NOT_MEASURED:
        forward, left = message.linear_acceleration.x, message.linear_acceleration.y
    measured = yaw_of(message.orientation)
    if message.orientation_covariance[0] != NOT_MEASURED and math.isfinite(measured):
        yaw, variance = measured, message.orientation_covariance[8]
        std = math.sqrt(variance) if variance > 0.0 else None
    return rate, forward, left, yaw, std


def to_quaternion(yaw: float) -> Quaternion:
    """Rotation about z [rad]."""
    return Quaternion(z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw))


def motion_of(message: Odometry) -> Motion:
    """Pose in the pool and velocity in base_link."""
    p, v = message.pose.pose, message.twist.twist
    return Motion(
        p.position.x, p.position.y, yaw_of(p.orientation), v.linear.x, v.linear.y, v.angular.z
    )


def planar_covariance(covariance: Sequence[float]) -> NDArray[np.float64]:
    """(36,) of a message to (3, 3) of x, y and yaw."""
    return np.reshape(planar_block(covariance), (3, 3))


def estimate_signs(message: Odometry, now: float) -> EstimateHealth:
    """What speaks for an estimate at `now` [s]."""
    return EstimateHealth(
        age=now - seconds(message.header.stamp),
        finite=motion_is_finite(motion_of(message)),
        pose_variance=largest_of(planar_variances(message.pose.covariance)),
        twist_variance=largest_of(planar_variances(message.twist.covariance)),
    )


def diagnostics(
    stamp: Time, name: str, level: bytes, message: str, values: dict[str, object]
) -> DiagnosticArray:
    """One status of one node."""
    status = DiagnosticStatus(
        level=level, name=name.lstrip("/"), message=message, hardware_id="fish"
    )
    status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    array = DiagnosticArray(status=[status])
    array.header.stamp = stamp
    return array
