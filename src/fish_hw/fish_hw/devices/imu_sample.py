# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One IMU measurement, and the turn from sensor axes to base_link."""

from dataclasses import dataclass

from fish_hw.devices.rotation import (
    Quaternion,
    Vector,
    conjugate,
    from_yaw_pitch_roll,
    multiply,
    normalised,
    rotate,
)
from fish_hw.settings.imu import ImuSettings


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
