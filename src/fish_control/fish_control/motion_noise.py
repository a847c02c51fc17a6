# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far the strapdown motion model may be wrong. Apart from the filter: other nodes read it and need no scipy."""

from __future__ import annotations

from dataclasses import dataclass


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
