# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What fusion says of itself: lost sensors and the camera's clock."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fish_control.estimate import Estimate
from fish_control.fusion import Fusion
from fish_control.fusion_config import FusionConfig
from fish_control.imu_heading import against_gyro

NOTABLE_OFFSET = 0.02  # s, difference to camera_offset that is worth a warning


def lost_sensors(estimate: Estimate) -> list[str]:
    """Names of the sensors that are lost."""
    pairs = (("camera", estimate.camera_lost), ("IMU", estimate.imu_lost))
    return [name for name, lost in pairs if lost]


def implausible_sample(values: Sequence[float | None], config: FusionConfig) -> str:
    """What is wrong with a sample that fusion counts as implausible.

    Args:
        values: yaw rate [rad/s], specific force ahead and to the left [m/s^2], then others; None: not measured.
    """
    yaw_rate, forward, left, *_ = (value or 0.0 for value in values)
    return (
        f"it says {yaw_rate:g} rad/s and {math.hypot(forward, left):g} m/s^2 in the plane, expected at most "
        f"{config.largest_yaw_rate:g} rad/s and {config.largest_accel:g} m/s^2"
    )


def clock_warning(fusion: Fusion) -> str | None:
    """What is wrong with the camera's stamps, None if nothing is known to be."""
    clock, given = fusion.camera_clock, fusion.config.camera_offset
    current = clock.current
    if clock.undecided:
        return "a clock was set, or images come later: poses wait until the IMU shows which"
    if current.sure and abs(current.offset - given) > max(NOTABLE_OFFSET, 3.0 * current.std):
        return (
            f"images are taken {-current.offset:.3f} s before their stamps: found and applied; "
            f"camera_offset says {given:g} s, set it to {current.offset:.3f}"
        )
    if clock.contradicted:
        return f"camera_offset {given:g} s contradicts the IMU; the right one is not yet sure"
    return None


def clock_values(fusion: Fusion) -> dict[str, str]:
    """The camera's clock for /diagnostics.

    camera_offset_s is to the clock of the heading that fusion uses, camera_offset_to_gyro_s to that of the gyro.
    """
    clock = fusion.camera_clock
    values = {
        "camera_offset_s": f"{fusion.applied_offset:.4f}",
        "camera_offset_std_s": f"{clock.current.std:.4f}",
        "camera_offset_sure": str(clock.current.sure).lower(),
        "camera_clock_jumps": str(clock.jumps),
        "camera_noise_factor": f"{math.sqrt(fusion.noise_scale.position):.2f}",
        "accelerometer_used": str(fusion.motion_model.accel_used).lower(),
        "accel_noise_m_s2": f"{fusion.motion_model.accel_noise:.3f}",
    }
    lead = fusion.imu_heading.lead
    if lead.sure:
        values["imu_heading_lead_s"] = f"{lead.offset:.4f}"
        values["imu_heading_lead_std_s"] = f"{lead.std:.4f}"
    if lead.sure and clock.current.sure:
        gyro = against_gyro(clock.current, lead)
        values["camera_offset_to_gyro_s"] = f"{gyro.offset:.4f}"
        values["camera_offset_to_gyro_std_s"] = f"{gyro.std:.4f}"
    if math.isfinite(clock.age):
        values["camera_latency_s"] = f"{clock.age:.3f}"
    return values
