# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Models of the robot's sensors: what they do wrong (SENSOR_EFFECTS) and how they are noisy."""

from fish_sim.sensors.camera_heading_offset import CameraHeadingOffset
from fish_sim.sensors.camera_latency import CameraLatency
from fish_sim.sensors.camera_marker import CameraMarker
from fish_sim.sensors.camera_scale import CameraScale
from fish_sim.sensors.gyro_scale import GyroScale
from fish_sim.sensors.imu_latency import ImuLatency
from fish_sim.sensors.imu_misalignment import ImuMisalignment
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
