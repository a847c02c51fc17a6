# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Builders of the messages that importers and tests write, as rosbags' message objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fish_bag.message_types import typestore

NS_PER_S = 1_000_000_000


def make(msgtype: str, **fields: Any) -> Any:
    """A message of any type; every field must be given."""
    return typestore().types[msgtype](**fields)


def header(stamp_ns: int, frame: str = "") -> Any:
    sec, nanosec = divmod(int(stamp_ns), NS_PER_S)
    stamp = make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def vector3(x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def pose(x: float, y: float, psi: float) -> Any:
    """A pose in the plane."""
    position = make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=0.0)
    half = 0.5 * float(psi)
    turn = make(
        "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(np.sin(half)), w=float(np.cos(half))
    )
    return make("geometry_msgs/msg/Pose", position=position, orientation=turn)


def pose_stamped(stamp_ns: int, frame: str, x: float, y: float, psi: float) -> Any:
    return make(
        "geometry_msgs/msg/PoseStamped", header=header(stamp_ns, frame), pose=pose(x, y, psi)
    )


def planar_covariance(variance: Sequence[float] | np.ndarray) -> np.ndarray:
    """(36,) covariance with the variances of x, y and psi on the diagonal."""
    matrix = np.zeros((6, 6))
    matrix[[0, 1, 5], [0, 1, 5]] = variance
    return matrix.ravel()


def camera_pose(
    stamp_ns: int, frame: str, xypsi: Sequence[float], variance: Sequence[float] | np.ndarray
) -> Any:
    body = make(
        "geometry_msgs/msg/PoseWithCovariance",
        pose=pose(*xypsi),
        covariance=planar_covariance(variance),
    )
    return make(
        "geometry_msgs/msg/PoseWithCovarianceStamped", header=header(stamp_ns, frame), pose=body
    )


def odometry(stamp_ns: int, xypsi: Sequence[float], uvr: Sequence[float]) -> Any:
    """Pose in pool, velocity in base_link, covariances zero."""
    where = make("geometry_msgs/msg/PoseWithCovariance", pose=pose(*xypsi), covariance=np.zeros(36))
    u, v, r = uvr
    twist = make("geometry_msgs/msg/Twist", linear=vector3(u, v, 0.0), angular=vector3(0.0, 0.0, r))
    speed = make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36))
    head = header(stamp_ns, "pool")
    return make(
        "nav_msgs/msg/Odometry", header=head, child_frame_id="base_link", pose=where, twist=speed
    )


def joints(
    stamp_ns: int, names: list[str], position: Sequence[float], velocity: Sequence[float] = ()
) -> Any:
    return make(
        "sensor_msgs/msg/JointState",
        header=header(stamp_ns),
        name=names,
        position=np.array(position, float),
        velocity=np.array(velocity, float),
        effort=np.zeros(0),
    )


def imu(
    stamp_ns: int, gyro: Sequence[float], accel: Sequence[float], orientation: Sequence[float]
) -> Any:
    """Angular velocity [rad/s], specific force [m/s^2], quaternion x, y, z, w; frame imu_link."""
    x, y, z, w = (float(q) for q in orientation)
    return make(
        "sensor_msgs/msg/Imu",
        header=header(stamp_ns, "imu_link"),
        orientation=make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
        orientation_covariance=np.zeros(9),
        angular_velocity=vector3(*gyro),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector3(*accel),
        linear_acceleration_covariance=np.zeros(9),
    )


def vector_stamped(stamp_ns: int, frame: str, xyz: Sequence[float]) -> Any:
    return make(
        "geometry_msgs/msg/Vector3Stamped", header=header(stamp_ns, frame), vector=vector3(*xyz)
    )


def number(value: float) -> Any:
    return make("std_msgs/msg/Float64", data=float(value))


def labelled_numbers(label: str, values: Sequence[float]) -> Any:
    """Float64MultiArray with one dimension whose label names the values."""
    n = len(values)
    dimension = make("std_msgs/msg/MultiArrayDimension", label=label, size=n, stride=n)
    layout = make("std_msgs/msg/MultiArrayLayout", dim=[dimension], data_offset=0)
    return make("std_msgs/msg/Float64MultiArray", layout=layout, data=np.array(values, float))


def path(stamp_ns: int, frame: str, points: np.ndarray) -> Any:
    """(P, 2) points [m]."""
    poses = [pose_stamped(stamp_ns, frame, x, y, 0.0) for x, y in points]
    return make("nav_msgs/msg/Path", header=header(stamp_ns, frame), poses=poses)


def battery(
    stamp_ns: int, voltage: float, current: float = np.nan, temperature: float = np.nan
) -> Any:
    unknown = dict.fromkeys(("charge", "capacity", "design_capacity", "percentage"), np.nan)
    return make(
        "sensor_msgs/msg/BatteryState",
        header=header(stamp_ns),
        voltage=float(voltage),
        current=float(current),
        temperature=float(temperature),
        **unknown,
        power_supply_status=2,
        power_supply_health=0,
        power_supply_technology=0,
        present=True,
        cell_voltage=np.zeros(0, np.float32),
        cell_temperature=np.zeros(0, np.float32),
        location="",
        serial_number="",
    )
