# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages to values and back, as bytes what goes out 50 or 100 times a second, and how a node says how it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TwistStamped, Vector3, Vector3Stamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Header

from fish_control.controller import Command
from fish_control.estimate import Estimate
from fish_control.imu_heading import LARGEST_YAW_STD
from fish_control.line_of_sight import Motion
from fish_control.planner import Plan
from fish_control.watchdog import EstimateHealth, is_plausible
from fish_node.arming import largest_of
from fish_node.nodes.message_bytes import MessageBytes, mark
from fish_node.nodes.status_log import StatusLog
from fish_node.rivals import Rivals

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

    None: not measured, which a first covariance of -1 says, or where a quaternion is none; a deviation that is not given. A yaw
    whose variance is below 0, no number or larger than any heading's is not measured either.
    """
    rate = forward = left = yaw = std = None
    if message.angular_velocity_covariance[0] != NOT_MEASURED:
        rate = message.angular_velocity.z
    if message.linear_acceleration_covariance[0] != NOT_MEASURED:
        forward, left = message.linear_acceleration.x, message.linear_acceleration.y
    measured, variance = yaw_of(message.orientation), message.orientation_covariance[8]
    known = math.isfinite(measured) and 0.0 <= variance <= LARGEST_YAW_STD**2
    if known and message.orientation_covariance[0] != NOT_MEASURED:
        yaw, std = measured, math.sqrt(variance) or None
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
        plausible=is_plausible(motion_of(message)),
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


POSE_PLACES, TWIST_PLACES = 4 + PLANAR_BLOCK, 43 + PLANAR_BLOCK  # of covariances among the numbers


class OdometryBytes:
    """odometry/filtered of an estimate; frames: of the pool and of the body."""

    def __init__(self, pool_frame: str, body_frame: str) -> None:
        message = Odometry(header=Header(frame_id=pool_frame), child_frame_id=body_frame)
        pose, twist = message.pose, message.twist
        pose.pose.position = Point(x=mark(0), y=mark(1))
        pose.pose.orientation = Quaternion(z=mark(2), w=mark(3))
        pose.covariance = [mark(4 + k) for k in range(36)]
        twist.twist.linear.x, twist.twist.linear.y, twist.twist.angular.z = map(mark, range(40, 43))
        twist.covariance = [mark(43 + k) for k in range(36)]
        self._bytes = MessageBytes(message, 79)
        self._numbers = np.zeros(79)  # covariances but of x, y and yaw are known to be zero

    def __call__(self, estimate: Estimate) -> bytes:
        """The message."""
        numbers, yaw = self._numbers, float(estimate.pose[2])
        numbers[:2] = estimate.pose[:2]
        numbers[2], numbers[3] = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        numbers[POSE_PLACES] = estimate.pose_covariance.ravel()
        numbers[40:43] = estimate.twist
        numbers[TWIST_PLACES] = estimate.twist_covariance.ravel()
        return self._bytes(to_stamp(estimate.time), numbers.tolist())


class CommandBytes:
    """joint_command.

    Rotor: position = phase of the oscillation (rad), velocity = phi_dot (rad/s). Rudder: position = alpha (rad).
    """

    def __init__(self) -> None:
        message = JointState(name=["rotor", "rudder"])
        message.position, message.velocity = [mark(0), mark(1)], [mark(2), 0.0]
        self._bytes = MessageBytes(message, 3)

    def __call__(self, stamp: Time, command: Command) -> bytes:
        """The message."""
        return self._bytes(stamp, (command.phase, command.alpha, command.rotor_speed))


class PlanBytes:
    """control/target, control/twist and tracking/error of a plan; frames: of the pool and of the body."""

    def __init__(self, pool_frame: str, body_frame: str) -> None:
        pool = Header(frame_id=pool_frame)
        target, twist = PoseStamped(header=pool), TwistStamped(header=Header(frame_id=body_frame))
        target.pose.position = Point(x=mark(0), y=mark(1))
        target.pose.orientation = Quaternion(z=mark(2), w=mark(3))
        twist.twist.linear.x, twist.twist.angular.z = mark(0), mark(1)
        error = Vector3Stamped(header=pool, vector=Vector3(x=mark(0), y=mark(1), z=mark(2)))
        self._target, self._twist = MessageBytes(target, 4), MessageBytes(twist, 2)
        self._error = MessageBytes(error, 3)

    def target(self, stamp: Time, plan: Plan) -> bytes:
        """Position of the lookahead point, orientation of the wanted course."""
        half: float = 0.5 * plan.errors.course
        at: NDArray[np.float64] = plan.at.target
        return self._target(stamp, (float(at[0]), float(at[1]), math.sin(half), math.cos(half)))

    def twist(self, stamp: Time, plan: Plan) -> bytes:
        """Wanted surge speed and yaw rate."""
        return self._twist(stamp, (plan.speed, plan.yaw_rate))

    def error(self, stamp: Time, plan: Plan) -> bytes:
        """Wanted minus actual: cross-track, heading, speed."""
        errors = plan.errors
        return self._error(stamp, (errors.cross_track, errors.heading, errors.speed))


class Reporter:
    """A node's status: on /diagnostics whenever it is reported, on the console when it changes.

    Args:
        node: whose status it is.
        output: what no other node may publish.
    """

    def __init__(self, node: Node, output: Publisher) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._log = StatusLog(node.get_logger())
        self._rivals = Rivals(output.topic_name, node.count_publishers, node.get_logger().warning)

    def report(self, level: bytes, message: str, values: dict[str, object]) -> None:
        """Say it."""
        self._log.say(level, message)
        if warning := self._rivals.warning():
            level, message = max(level, WARN), f"{message}; {warning}"
        now, name = self._node.get_clock().now().to_msg(), self._node.get_fully_qualified_name()
        self._publisher.publish(diagnostics(now, name, level, message, values))
