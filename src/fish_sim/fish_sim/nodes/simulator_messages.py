# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of the simulator node from the values of the simulation, and back."""

import math
from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Imu, JointState
from std_msgs.msg import Header

from fish_sim.sensors.imu import ImuSample
from fish_sim.sensors.overhead_camera import CameraPose
from fish_sim.sensors.settings import SensorSettings
from fish_sim.simulation import Truth


def command(msg: JointState) -> tuple[float, float]:
    """(rotor speed [rad/s], rudder [rad]) of a joint_command; ValueError says what is missing."""
    names = list(msg.name)
    for name, field, values in (
        ("rotor", "velocity", msg.velocity),
        ("rudder", "position", msg.position),
    ):
        if name not in names or names.index(name) >= len(values):
            raise ValueError(
                f"got names {names} with {len(values)} {field} values; expected {name}'s {field}"
            )
    return msg.velocity[names.index("rotor")], msg.position[names.index("rudder")]


def quaternion(heading: float) -> Quaternion:
    """Rotation about z."""
    return Quaternion(z=math.sin(heading / 2), w=math.cos(heading / 2))


def odometry(header: Header, body_frame: str, truth: Truth) -> Odometry:
    """The truth: pose in the header's frame, the pool; velocity in base_link, zero covariance."""
    msg = Odometry(header=header, child_frame_id=body_frame)
    position, twist = msg.pose.pose.position, msg.twist.twist
    position.x, position.y = truth.pose[:2]
    msg.pose.pose.orientation = quaternion(truth.pose[2])
    twist.linear.x, twist.linear.y, twist.angular.z = truth.velocity
    return msg


def tail(header: Header, truth: Truth) -> JointState:
    """tail_1 .. relative angles."""
    names = [f"tail_{i}" for i in range(1, len(truth.tail) + 1)]
    return JointState(header=header, name=names, position=truth.tail)


def rotor(header: Header, measured: tuple[float, float]) -> JointState:
    """Angle and speed of the rotor's encoder."""
    return JointState(header=header, name=["rotor"], position=measured[:1], velocity=measured[1:])


def imu(header: Header, sample: ImuSample, settings: SensorSettings) -> Imu:
    """Orientation without absolute heading, rates, specific force."""
    msg = Imu(header=header, orientation=quaternion(sample.yaw))
    rate, force = msg.angular_velocity, msg.linear_acceleration
    rate.x, rate.y, rate.z = sample.angular_velocity.tolist()
    force.x, force.y, force.z = sample.specific_force.tolist()
    for field, std in (
        ("orientation", settings.orientation_noise),
        ("angular_velocity", settings.gyro_noise),
        ("linear_acceleration", settings.accelerometer_noise),
    ):
        setattr(msg, f"{field}_covariance", _diagonal((std, std, std)))
    return msg


def camera_pose(
    header: Header, sample: CameraPose, settings: SensorSettings
) -> PoseWithCovarianceStamped:
    """Pose of the head as the tracker would give it."""
    msg = PoseWithCovarianceStamped(header=header)
    msg.pose.pose.position.x, msg.pose.pose.position.y = sample.x, sample.y
    msg.pose.pose.orientation = quaternion(sample.heading)
    along, turn = settings.camera_position_noise, settings.camera_heading_noise
    msg.pose.covariance = _diagonal((along, along, 0.0, 0.0, 0.0, turn))
    return msg


def battery(header: Header, voltage: float) -> BatteryState:
    """Terminal voltage; what is not measured is NaN, as the message asks."""
    nan = math.nan
    msg = BatteryState(header=header, voltage=voltage, temperature=nan, current=nan, charge=nan)
    msg.capacity = msg.design_capacity = msg.percentage = nan
    msg.power_supply_status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    msg.power_supply_technology = BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO
    msg.present = True
    return msg


def status(name: str, level: bytes, text: str, values: Mapping[str, str]) -> DiagnosticStatus:
    """One entry of /diagnostics."""
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(
        name=name, hardware_id="simulated fish", level=level, message=text, values=pairs
    )


def _diagonal(std: tuple[float, ...]) -> list[float]:
    """Covariance matrix, row by row, of independent errors."""
    size = len(std)
    return [std[i] ** 2 if i == j else 0.0 for i in range(size) for j in range(size)]
