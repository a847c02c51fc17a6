# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What fusion, planner and controller publish 50 or 100 times a second, as bytes."""

from __future__ import annotations

import math

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TwistStamped, Vector3, Vector3Stamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fish_control.controller import Command
from fish_control.estimate import Estimate
from fish_control.nodes.messages import PLANAR_BLOCK, to_stamp
from fish_control.planner import Plan
from fish_node.nodes.message_bytes import MessageBytes, mark

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
