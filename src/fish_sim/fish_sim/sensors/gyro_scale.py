# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A gyroscope with another sensitivity than assumed."""

from types import SimpleNamespace
from typing import Any

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "sensitivity error of MEMS gyroscopes (data sheets: up to 4 %); strength is an assumption"


class GyroScale(SensorEffect):
    """The gyroscope's rate is the true one times a factor. Neutral: 1."""

    name = "gyro_scale"
    equation = "measured rate = factor rate"
    source = SOURCE
    parameters = {"factor": Parameter(1.0, "1", 0.5, 2.0, SOURCE, typical=1.05)}
    strength = ("factor",)

    @staticmethod
    def imu(
        p: SimpleNamespace, ahead: Scalar, left: Scalar, rate: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return ahead, left, p.factor * rate
