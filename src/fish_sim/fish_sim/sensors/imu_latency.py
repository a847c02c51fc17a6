# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""IMU readings that are older than they say."""

from types import SimpleNamespace

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "filtering and transport of the IMU's readings; strength is an assumption"


class ImuLatency(SensorEffect):
    """The reading stamped t is the fish's at t - delay, of all the IMU's values alike."""

    name = "imu_latency"
    equation = "IMU reading(t) is the fish's at t - delay"
    source = SOURCE
    parameters = {"delay": Parameter(0.0, "s", 0.0, 0.5, SOURCE, typical=0.02)}
    strength = ("delay",)

    @staticmethod
    def imu_delay(p: SimpleNamespace) -> Scalar:
        return p.delay
