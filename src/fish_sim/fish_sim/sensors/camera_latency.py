# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Images that are older than they say."""

from types import SimpleNamespace

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "transport and exposure of the camera; strength is an assumption"
# a stroke of half a second repeats the heading: a search does not walk over a quarter of it
DELAYS = (0.05, 0.15, 0.25, 0.35, 0.45, 0.55)


class CameraLatency(SensorEffect):
    """The pose stamped t shows the fish at t - delay."""

    name = "camera_latency"
    equation = "pose(t) shows the fish at t - delay"
    source = SOURCE
    parameters = {"delay": Parameter(0.0, "s", 0.0, 1.0, SOURCE, typical=0.05, tries=DELAYS)}
    strength = ("delay",)

    @staticmethod
    def pose_delay(p: SimpleNamespace) -> Scalar:
        return p.delay
