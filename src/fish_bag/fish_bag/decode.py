# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From decoded message fields to the arrays of a stream: one function per role, all listed in ROLES."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fish_bag.layout import Block
from fish_bag.trial import (
    Battery,
    Camera,
    Commands,
    Encoder,
    Gains,
    Imu,
    Odometry,
    ReferenceSpeed,
    Stream,
    Tail,
    Target,
    TrackingError,
)

POSE_ROWS = np.array([0, 1, 5])  # x, y, rotation about z in a 6x6 covariance (REP 103 order)
NOT_MEASURED = "not_measured"  # an array of a stream of its own: (n, columns)
ABSENT_COLUMNS = {"gyro": 0, "accel": 1, "x": 0, "y": 0, "psi": 0}  # its column for an array
# arrays of a role -> joint and field of sensor_msgs/JointState
JOINT_VALUES = {
    "commands": {
        "rotor_phase": ("rotor", "position"),
        "rotor_speed": ("rotor", "velocity"),
        "rudder": ("rudder", "position"),
    },
    "encoder": {"angle": ("rotor", "position"), "speed": ("rotor", "velocity")},
}
Arrays = dict[str, np.ndarray]


def yaw(block: Block, path: str) -> np.ndarray:
    """Heading of quaternions of any length: psi = atan2(2 (w z + x y), w^2 + x^2 - y^2 - z^2)."""
    x, y, z, w = (block.values[f"{path}.{k}"] for k in "xyzw")
    psi = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return np.where(x * x + y * y + z * z + w * w > 0, psi, np.nan)


def joint(block: Block, name: str, value: str) -> np.ndarray:
    """`value` ("position" or "velocity") of the named joint, NaN where the message does not carry it."""
    names, columns = block.texts["name"], block.values[value]
    if name not in names or names.index(name) >= columns.shape[1]:
        return np.full(len(block.index), np.nan)
    return columns[:, names.index(name)]


def vector(block: Block, path: str) -> np.ndarray:
    """(n, 3) of a Vector3 field."""
    return np.column_stack([block.values[f"{path}.{k}"] for k in "xyz"])


def commands(block: Block) -> Arrays:
    return {key: joint(block, *where) for key, where in JOINT_VALUES["commands"].items()}


def encoder(block: Block) -> Arrays:
    return {key: joint(block, *where) for key, where in JOINT_VALUES["encoder"].items()}


def imu(block: Block) -> Arrays:
    """sensor_msgs/Imu: a first covariance of -1 means "not measured"."""
    quaternion = np.column_stack([block.values[f"orientation.{k}"] for k in "xyzw"])
    absent = (block.values["orientation_covariance"][:, 0] == -1) | ~quaternion.any(axis=1)
    quaternion[absent] = np.nan
    gyro, no_gyro = _measured(block, "angular_velocity")
    accel, no_accel = _measured(block, "linear_acceleration")
    return {
        "gyro": gyro,
        "accel": accel,
        "orientation": quaternion,
        NOT_MEASURED: np.column_stack([no_gyro, no_accel]),
    }


def _measured(block: Block, path: str) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) of a vector, NaN where its covariance says that it is not measured; and (n,) where it says so."""
    values = vector(block, path).astype(float)
    absent = block.values[f"{path}_covariance"][:, 0] == -1
    values[absent] = np.nan
    return values, absent


def camera(block: Block) -> Arrays:
    """A pose of which a variance is below 0, such as -1, is not measured: a part of a pose is used nowhere."""
    covariance = block.values["pose.covariance"].reshape(-1, 6, 6)[:, POSE_ROWS[:, None], POSE_ROWS]
    position = vector(block, "pose.pose.position")
    pose = np.column_stack([position[:, :2], yaw(block, "pose.pose.orientation")])
    absent: np.ndarray = np.any(np.diagonal(covariance, axis1=1, axis2=2) < 0.0, axis=1)
    pose[absent] = np.nan
    x, y, psi = pose.T
    return {"x": x, "y": y, "psi": psi, "covariance": covariance, NOT_MEASURED: absent[:, None]}


def tail(block: Block) -> Arrays:
    return {"angle": block.values["position"]}


def odometry(block: Block) -> Arrays:
    position = vector(block, "pose.pose.position")
    speed = vector(block, "twist.twist.linear")
    return {
        "x": position[:, 0],
        "y": position[:, 1],
        "psi": yaw(block, "pose.pose.orientation"),
        "u": speed[:, 0],
        "v": speed[:, 1],
        "r": block.values["twist.twist.angular.z"],
    }


def gains(block: Block) -> Arrays:
    return {"values": block.values["data"]}


def target(block: Block) -> Arrays:
    position = vector(block, "pose.position")
    return {"x": position[:, 0], "y": position[:, 1], "course": yaw(block, "pose.orientation")}


def tracking_error(block: Block) -> Arrays:
    error = vector(block, "vector")
    return {"cross_track": error[:, 0], "heading": error[:, 1], "speed": error[:, 2]}


def battery(block: Block) -> Arrays:
    return {"voltage": block.values["voltage"].astype(float)}


def reference_speed(block: Block) -> Arrays:
    return {"speed": block.values["data"]}


@dataclass(frozen=True)
class Role:
    """What a topic is read as."""

    stream: type[Stream]
    type: str  # message type
    decode: Callable[[Block], Arrays]
    optional: tuple[str, ...] = ()  # arrays that may be NaN without harm
    names: str | None = None  # text field that names the columns


JOINTS, ODOMETRY = "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
ROLES: dict[str, Role] = {
    "commands": Role(Commands, JOINTS, commands),
    "encoder": Role(Encoder, JOINTS, encoder, optional=("angle",)),
    "imu": Role(Imu, "sensor_msgs/msg/Imu", imu, optional=("orientation",)),
    "camera": Role(Camera, POSE, camera, optional=("covariance",)),
    "tail": Role(Tail, JOINTS, tail, names="name"),
    "odometry": Role(Odometry, ODOMETRY, odometry),
    "truth": Role(Odometry, ODOMETRY, odometry),
    "gains": Role(Gains, "std_msgs/msg/Float64MultiArray", gains, names="layout.dim.0.label"),
    "target": Role(Target, "geometry_msgs/msg/PoseStamped", target),
    "tracking_error": Role(TrackingError, "geometry_msgs/msg/Vector3Stamped", tracking_error),
    "battery": Role(Battery, "sensor_msgs/msg/BatteryState", battery),
    "reference_speed": Role(ReferenceSpeed, "std_msgs/msg/Float64", reference_speed),
}
PATH_ROLE, PATH_TYPE = "reference_paths", "nav_msgs/msg/Path"
