"""Images that are older than they say."""

from types import SimpleNamespace

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

SOURCE = "transport and exposure of the camera; strength is an assumption"


class CameraLatency(SensorEffect):
    """The pose stamped t shows the fish at t - delay."""

    name = "camera_latency"
    equation = "pose(t) shows the fish at t - delay"
    source = SOURCE
    parameters = {"delay": Parameter(0.0, "s", 0.0, 1.0, SOURCE, typical=0.05)}
    strength = ("delay",)

    @staticmethod
    def pose_delay(p: SimpleNamespace) -> Scalar:
        return p.delay
