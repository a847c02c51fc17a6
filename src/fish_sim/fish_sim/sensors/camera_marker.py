# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A camera that follows another point of the head than its centre of mass."""

from types import SimpleNamespace
from typing import Any

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "mounting of the markers; strength is an assumption"


class CameraMarker(SensorEffect):
    """The camera's position is that of a point `ahead` of the head's centre of mass; behind it where negative."""

    name = "camera_marker"
    equation = "camera position = position + ahead (cos heading, sin heading)"
    source = SOURCE
    parameters = {"ahead": Parameter(0.0, "m", -0.15, 0.15, SOURCE, typical=0.02)}
    strength = ("ahead",)

    @staticmethod
    def pose(
        p: SimpleNamespace, x: Scalar, y: Scalar, heading: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return x + p.ahead * xp.cos(heading), y + p.ahead * xp.sin(heading), heading
