# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""IMU samples that no fish can have produced."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fish_control.fusion_config import FusionConfig


def unusable_sample(values: Sequence[float | None], config: FusionConfig) -> str:
    """Why a sample is used nowhere, as fusion counts it; "" if it is usable.

    Args:
        values: stamp [s], yaw rate [rad/s], specific force ahead and to the left [m/s^2], then others; None: not measured.
    """
    if not all(math.isfinite(v) for v in values if v is not None):
        return "imu_not_finite"
    _, yaw_rate, forward, left, *_ = (v or 0.0 for v in values)
    if math.hypot(forward, left) > config.largest_accel or abs(yaw_rate) > config.largest_yaw_rate:
        return "imu_implausible"
    return ""
