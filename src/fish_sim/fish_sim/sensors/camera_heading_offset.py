# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A heading marker that sits at an angle."""

from types import SimpleNamespace
from typing import Any

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "mounting of the markers; strength is an assumption"


class CameraHeadingOffset(SensorEffect):
    """The camera's heading is the fish's plus a constant angle."""

    name = "camera_heading_offset"
    equation = "camera heading = heading + offset"
    source = SOURCE
    parameters = {"offset": Parameter(0.0, "rad", -0.8, 0.8, SOURCE, typical=0.06)}
    strength = ("offset",)

    @staticmethod
    def pose(
        p: SimpleNamespace, x: Scalar, y: Scalar, heading: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return x, y, heading + p.offset
