# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Noise, bias, timing of the simulated sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from fish_sim.sensors import noise_levels as levels


@dataclass(frozen=True)
class SensorSettings:
    """Standard deviations are those of the supplied recordings where these give them."""

    gyro_noise: float = levels.GYRO  # rad/s, std per sample
    gyro_bias: float = levels.SIMULATOR_GYRO_BIAS  # rad/s, std of the constant bias
    accelerometer_noise: float = levels.ACCELEROMETER  # m/s^2, std per sample
    accelerometer_bias: float = (
        levels.SIMULATOR_ACCELEROMETER_BIAS
    )  # m/s^2, std of the constant bias
    orientation_noise: float = 0.003  # rad, std per sample
    orientation_drift: float = (
        0.001  # rad/sqrt(s), random walk of the yaw, which starts at an unknown angle
    )
    encoder_angle_noise: float = 0.002  # rad, std per sample
    encoder_speed_noise: float = levels.SIMULATOR_ENCODER_SPEED  # rad/s, std per sample
    camera_rate: float = levels.CAMERA_RATE  # Hz
    camera_jitter: float = levels.SIMULATOR_CAMERA_JITTER  # s, std of the time between frames
    camera_loss: float = levels.CAMERA_LOSS  # share of frames that are lost
    camera_latency: float = levels.CAMERA_LATENCY  # s, from exposure (the stamp) to arrival
    camera_position_noise: float = levels.CAMERA_POSITION  # m, std per axis
    camera_heading_noise: float = levels.CAMERA_HEADING  # rad, std
    battery_voltage: float = 12.4  # V, full, without load
    battery_resistance: float = 0.08  # ohm
    battery_capacity: float = 1.3  # A h; the open-circuit voltage falls by 2 V over it
    battery_noise: float = 0.01  # V, std per sample

    def __post_init__(self) -> None:
        for item in fields(SensorSettings):
            value = getattr(self, item.name)
            if not math.isfinite(value) or value < 0.0:
                raise ValueError(f"{item.name} = {value}: expected a finite number, at least 0")
        for name, low, high in (
            ("camera_rate", 0.1, 100.0),
            ("camera_loss", 0.0, 1.0),
            ("camera_latency", 0.0, 1.0),
            ("camera_jitter", 0.0, 0.2 / self.camera_rate if self.camera_rate else 0.0),
            ("battery_voltage", 1.0, 60.0),
            ("battery_capacity", 0.01, 1000.0),
        ):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} = {getattr(self, name)}: expected {low:g} to {high:g}")
