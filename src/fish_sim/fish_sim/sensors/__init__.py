# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Models of the robot's sensors: what they do wrong (SENSOR_EFFECTS) and how they are noisy."""

from fish_sim.sensors.errors import (
    CameraHeadingOffset,
    CameraLatency,
    CameraMarker,
    CameraScale,
    GyroScale,
    ImuLatency,
    ImuMisalignment,
)
from fish_sim.sensors.sensor_effect import SensorEffect

SENSOR_EFFECTS: dict[str, type[SensorEffect]] = {
    "camera_latency": CameraLatency,
    "camera_heading_offset": CameraHeadingOffset,
    "camera_marker": CameraMarker,
    "camera_scale": CameraScale,
    "gyro_scale": GyroScale,
    "imu_misalignment": ImuMisalignment,
    "imu_latency": ImuLatency,
}


def changes_camera_poses(name: str) -> bool:
    """Whether a sensor effect is one of the camera; a rendered picture does not show it."""
    effect = SENSOR_EFFECTS[name]
    return effect.pose is not SensorEffect.pose or effect.pose_delay is not SensorEffect.pose_delay
