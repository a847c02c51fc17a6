# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of the simulator node from the values of the simulation, and back; its state as a line of /diagnostics."""

from __future__ import annotations

import math
from collections.abc import Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, Imu, JointState
from std_msgs.msg import Header

from fish_node.nodes.message_bytes import MessageBytes, mark
from fish_sim.sensors.onboard import ImuSample
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


class PeriodMessages:
    """The bytes of what goes out in every period.

    Args:
        frames: of the pool, of the head, of the IMU.
        links: of the tail.
    """

    def __init__(self, frames: tuple[str, str, str], links: int, settings: SensorSettings) -> None:
        pool, body, imu_link = (Header(frame_id=frame) for frame in frames)
        self._clock = MessageBytes(Clock(), 0)
        self._odometry = MessageBytes(_odometry(pool, frames[1]), 7)
        names = [f"tail_{i}" for i in range(1, links + 1)]
        tail = JointState(header=body, name=names, position=[mark(i) for i in range(links)])
        self._tail = MessageBytes(tail, links)
        rotor = JointState(header=body, name=["rotor"], position=[mark(0)], velocity=[mark(1)])
        self._rotor = MessageBytes(rotor, 2)
        self._imu = MessageBytes(_imu(imu_link, settings), 8)

    def clock(self, stamp: Time) -> bytes:
        """rosgraph_msgs/Clock."""
        return self._clock(stamp)

    def odometry(self, stamp: Time, truth: Truth) -> bytes:
        """nav_msgs/Odometry, the truth: pose in the pool; velocity in base_link, zero covariance."""
        x, y, heading = truth.pose
        return self._odometry(
            stamp, (x, y, math.sin(heading / 2), math.cos(heading / 2), *truth.velocity)
        )

    def tail(self, stamp: Time, truth: Truth) -> bytes:
        """sensor_msgs/JointState: tail_1 .. relative angles."""
        return self._tail(stamp, truth.tail)

    def rotor(self, stamp: Time, measured: tuple[float, float]) -> bytes:
        """sensor_msgs/JointState: angle and speed of the rotor's encoder."""
        return self._rotor(stamp, measured)

    def imu(self, stamp: Time, sample: ImuSample) -> bytes:
        """sensor_msgs/Imu: orientation without absolute heading, rates, specific force."""
        half = sample.yaw / 2
        rates, forces = sample.angular_velocity.tolist(), sample.specific_force.tolist()
        return self._imu(stamp, (math.sin(half), math.cos(half), *rates, *forces))


def _odometry(header: Header, body_frame: str) -> Odometry:
    """With marks for x, y, orientation z, w, surge, sway and yaw rate."""
    msg = Odometry(header=header, child_frame_id=body_frame)
    position, twist = msg.pose.pose.position, msg.twist.twist
    position.x, position.y = mark(0), mark(1)
    msg.pose.pose.orientation = Quaternion(z=mark(2), w=mark(3))
    twist.linear.x, twist.linear.y, twist.angular.z = mark(4), mark(5), mark(6)
    return msg


def _imu(header: Header, settings: SensorSettings) -> Imu:
    """With marks for orientation z, w, rates and specific force."""
    msg = Imu(header=header, orientation=Quaternion(z=mark(0), w=mark(1)))
    rate, force = msg.angular_velocity, msg.linear_acceleration
    rate.x, rate.y, rate.z = mark(2), mark(3), mark(4)
    force.x, force.y, force.z = mark(5), mark(6), mark(7)
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


SLOW = 0.95  # share of the asked pace below which the node says that it lags


def health(
    divergences: int,
    refusal: str,
    paused: bool,
    lost: float,
    awaited: str,
    pace: float,
    asked: float,
    disarmed: str,
) -> tuple[bytes, str]:
    """(level, text), the worst news first.

    refusal: why the last command was refused; lost: s of real time that were skipped; awaited: what lockstep waits for; pace,
    asked: simulated seconds in a second; disarmed: the reason. A text is empty where there is nothing to say.
    """
    if divergences:
        return DiagnosticStatus.ERROR, f"the motion diverged {divergences} times"
    if refusal:
        return DiagnosticStatus.WARN, f"joint_command refused: {refusal}"
    if paused:
        return DiagnosticStatus.OK, "paused"
    if lost > 0.0:
        return DiagnosticStatus.WARN, f"behind real time, {lost:.2f} s skipped in the last second"
    if awaited:
        return DiagnosticStatus.WARN, f"waits for {awaited}"
    if pace < SLOW * asked:
        return DiagnosticStatus.WARN, f"behind real time, running at {pace:.2f}"
    if disarmed:
        return DiagnosticStatus.WARN, f"disarmed: {disarmed}"
    return DiagnosticStatus.OK, "running"
