# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the fusion; first how far its motion model may be wrong. Other nodes read them and need no filter for it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations of the motion model; per sample means per sample at 100 Hz."""

    gyro_noise: float = 0.006  # rad/s per sample
    accel_noise: float = 0.05  # m/s^2 per sample
    gyro_drift: float = 1e-4  # rad/s per sqrt(s), of the bias
    accel_drift: float = 1e-3  # m/s^2 per sqrt(s), of the biases
    heading_drift: float = 0.001  # rad per sqrt(s), of the IMU's heading against the camera's
    coasting_yaw_rate: float = (
        2.0  # rad/s, unknown yaw rate without IMU (the head swings at up to 4 rad/s)
    )
    coasting_accel: float = 1.0  # m/s^2, unknown acceleration without IMU


@dataclass(frozen=True)
class FusionConfig(MotionNoise):
    """Constants of the fusion and its motion model; standard deviations unless said otherwise."""

    camera_position_noise: float = 0.002  # m, of a pose whose message gives none
    camera_heading_noise: float = 0.012  # rad, the same
    imu_heading_noise: float = 0.003  # rad, of an orientation whose message gives none
    gate: float = 16.27  # squared Mahalanobis distance, chi^2 of 3 at 99.9 %
    history: float = 2.0  # s, how old a pose may be when it comes
    camera_timeout: float = 0.6  # s in which no pose is accepted, however old it is: camera lost
    imu_timeout: float = (
        0.1  # s without a sample: IMU lost; s that a pose may be ahead of the newest sample
    )
    reacquire_time: float = (
        1.0  # s of poses that agree, but not with the estimate: start anew from them
    )
    start_frames: int = 3  # poses that must agree before the first estimate
    imu_x: float = 0.0  # m, place of the IMU ahead of the head's centre of mass
    imu_y: float = 0.0  # m, and to the left of it
    camera_offset: float = (
        0.0  # s, added to camera stamps (negative if images are older than their stamps)
    )
    camera_offset_std: float = 0.02  # s, how far this may be wrong before it is found
    estimate_offset: bool = True  # find and apply the camera's offset; false: camera_offset stays
    largest_accel: float = (
        20.0  # m/s^2 in the plane; a sample above it is wrong (trials reach 1.84)
    )
    largest_yaw_rate: float = 12.0  # rad/s; a sample above it is wrong (trials reach 5.3)

    def __post_init__(self) -> None:
        for f in fields(FusionConfig):
            value = getattr(self, f.name)
            if isinstance(value, bool):
                continue
            any_sign = f.name in ("camera_offset", "imu_x", "imu_y")
            if not (math.isfinite(value) and (any_sign or value > 0.0)):
                expected = "a finite number" if any_sign else "a finite number > 0"
                raise ValueError(f"{f.name} is {value!r}, expected {expected}")
