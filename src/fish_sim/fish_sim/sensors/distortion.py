# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The enabled sensor effects of a robot, applied one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

from fish_sim.ops import NUMPY
from fish_sim.sensors import SENSOR_EFFECTS


class SensorDistortion:
    """Sensor effects by name with their parameter values, in the order of SENSOR_EFFECTS."""

    def __init__(self, enabled: Mapping[str, Mapping[str, float]]) -> None:
        self._effects = [
            (SENSOR_EFFECTS[name], SimpleNamespace(**values)) for name, values in enabled.items()
        ]

    def pose_delay(self) -> float:
        """Sum of the delays [s]."""
        return float(sum(effect.pose_delay(p) for effect, p in self._effects))

    def imu_delay(self) -> float:
        """Sum of the IMU's delays [s]."""
        return float(sum(effect.imu_delay(p) for effect, p in self._effects))

    def pose(self, x: float, y: float, heading: float) -> tuple[float, float, float]:
        """Camera pose from the true one."""
        for effect, p in self._effects:
            x, y, heading = effect.pose(p, x, y, heading, NUMPY)
        return x, y, heading

    def imu(self, ahead: float, left: float, rate: float) -> tuple[float, float, float]:
        """Specific force and rate in the IMU's own axes."""
        for effect, p in self._effects:
            ahead, left, rate = effect.imu(p, ahead, left, rate, NUMPY)
        return ahead, left, rate
