# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A camera whose metres are not metres."""

from types import SimpleNamespace
from typing import Any

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "calibration of the camera; strength is an assumption"


class CameraScale(SensorEffect):
    """The camera's position is the true one times a factor, about the pool's centre. Neutral: 1."""

    name = "camera_scale"
    equation = "camera position = factor position"
    source = SOURCE
    parameters = {"factor": Parameter(1.0, "1", 0.5, 2.0, SOURCE, typical=1.05)}
    strength = ("factor",)

    @staticmethod
    def pose(
        p: SimpleNamespace, x: Scalar, y: Scalar, heading: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return p.factor * x, p.factor * y, heading
