# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One IMU measurement, and the turn from sensor axes to base_link; rotations are unit quaternions as (x, y, z, w)."""

import math
from dataclasses import dataclass

from fish_hw.settings import ImuSettings

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]


def from_yaw_pitch_roll(yaw: float, pitch: float, roll: float) -> Quaternion:
    """Quaternion of R = R_z(yaw) R_y(pitch) R_x(roll); angles in rad."""
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    return (
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Quaternion of R_a R_b."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q: Quaternion) -> Quaternion:
    """Quaternion of the inverse rotation."""
    x, y, z, w = q
    return (-x, -y, -z, w)


def rotate(q: Quaternion, v: Vector) -> Vector:
    """R v."""
    x, y, z, _ = multiply(multiply(q, (*v, 0.0)), conjugate(q))
    return (x, y, z)


def norm(q: Quaternion) -> float:
    """Length, 1 for a rotation."""
    return math.hypot(*q)


def normalised(q: Quaternion) -> Quaternion:
    """q / |q|."""
    n = norm(q)
    x, y, z, w = q
    return (x / n, y / n, z / n, w / n)


def mean_rate(earlier: Quaternion, later: Quaternion, dt: float) -> Vector:
    """Constant angular velocity [rad/s, body axes] that turns earlier into later within dt [s]."""
    x, y, z, w = multiply(conjugate(earlier), later)
    sign = math.copysign(1.0, w)  # q and -q are the same rotation; take the short way
    sine = math.hypot(x, y, z)
    scale = sign * 2.0 * math.atan2(sine, abs(w)) / (sine * dt) if sine > 0.0 else 0.0
    return (scale * x, scale * y, scale * z)


@dataclass(frozen=True)
class ImuSample:
    """Measured at time_s [monotonic clock].

    orientation: body to a level frame with unknown constant yaw; angular_velocity [rad/s] and acceleration
    (specific force, [m/s^2]) in body axes; accuracy 0 (unreliable) to 3 (high).
    """

    time_s: float
    orientation: Quaternion
    angular_velocity: Vector
    acceleration: Vector
    accuracy: int


class Mounting:
    """How the sensor sits in the hull: q_base_sensor from the settings' angles.

    v_base = R_base_sensor v_sensor,   R_level_base = R_level_sensor R_base_sensor^T
    """

    def __init__(self, settings: ImuSettings) -> None:
        self._q = from_yaw_pitch_roll(settings.mount_yaw, settings.mount_pitch, settings.mount_roll)

    def to_base(self, sample: ImuSample) -> ImuSample:
        """The sample in base_link axes."""
        return ImuSample(
            sample.time_s,
            normalised(multiply(sample.orientation, conjugate(self._q))),
            rotate(self._q, sample.angular_velocity),
            rotate(self._q, sample.acceleration),
            sample.accuracy,
        )
