# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An IMU that is glued in at an angle."""

from types import SimpleNamespace
from typing import Any

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "mounting error; strength is an assumption"


class ImuMisalignment(SensorEffect):
    """The IMU's axes are turned by `angle` about z (counter-clockwise) against the head's.

    measured = R(-angle) specific force; the rate about z is unchanged.
    """

    name = "imu_misalignment"
    equation = "measured specific force = R(-angle) specific force"
    source = SOURCE
    parameters = {"angle": Parameter(0.0, "rad", -0.8, 0.8, SOURCE, typical=0.1)}
    strength = ("angle",)

    @staticmethod
    def imu(
        p: SimpleNamespace, ahead: Scalar, left: Scalar, rate: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        cos, sin = xp.cos(p.angle), xp.sin(p.angle)
        return cos * ahead + sin * left, cos * left - sin * ahead, rate
