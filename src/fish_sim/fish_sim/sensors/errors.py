# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What camera and IMU do wrong: late, turned, shifted and scaled readings."""

from types import SimpleNamespace
from typing import Any

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter
from fish_sim.sensors.sensor_effect import SensorEffect

# a stroke of half a second repeats the heading: a search does not walk over a quarter of it
DELAYS = (0.05, 0.15, 0.25, 0.35, 0.45, 0.55)


class CameraLatency(SensorEffect):
    """The pose stamped t shows the fish at t - delay."""

    name = "camera_latency"
    equation = "pose(t) shows the fish at t - delay"
    source = "transport and exposure of the camera; strength is an assumption"
    parameters = {"delay": Parameter(0.0, "s", 0.0, 1.0, source, typical=0.05, tries=DELAYS)}
    strength = ("delay",)

    @staticmethod
    def pose_delay(p: SimpleNamespace) -> Scalar:
        return p.delay


class CameraHeadingOffset(SensorEffect):
    """The camera's heading is the fish's plus a constant angle."""

    name = "camera_heading_offset"
    equation = "camera heading = heading + offset"
    source = "mounting of the markers; strength is an assumption"
    parameters = {"offset": Parameter(0.0, "rad", -0.8, 0.8, source, typical=0.06)}
    strength = ("offset",)

    @staticmethod
    def pose(
        p: SimpleNamespace, x: Scalar, y: Scalar, heading: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return x, y, heading + p.offset


class CameraMarker(SensorEffect):
    """The camera's position is that of a point `ahead` of the head's centre of mass; behind it where negative."""

    name = "camera_marker"
    equation = "camera position = position + ahead (cos heading, sin heading)"
    source = "mounting of the markers; strength is an assumption"
    parameters = {"ahead": Parameter(0.0, "m", -0.15, 0.15, source, typical=0.02)}
    strength = ("ahead",)

    @staticmethod
    def pose(
        p: SimpleNamespace, x: Scalar, y: Scalar, heading: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return x + p.ahead * xp.cos(heading), y + p.ahead * xp.sin(heading), heading


class CameraScale(SensorEffect):
    """The camera's position is the true one times a factor, about the pool's centre. Neutral: 1."""

    name = "camera_scale"
    equation = "camera position = factor position"
    source = "calibration of the camera; strength is an assumption"
    parameters = {"factor": Parameter(1.0, "1", 0.5, 2.0, source, typical=1.05)}
    strength = ("factor",)

    @staticmethod
    def pose(
        p: SimpleNamespace, x: Scalar, y: Scalar, heading: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return p.factor * x, p.factor * y, heading


class GyroScale(SensorEffect):
    """The gyroscope's rate is the true one times a factor. Neutral: 1."""

    name = "gyro_scale"
    equation = "measured rate = factor rate"
    source = (
        "sensitivity error of MEMS gyroscopes (data sheets: up to 4 %); strength is an assumption"
    )
    parameters = {"factor": Parameter(1.0, "1", 0.5, 2.0, source, typical=1.05)}
    strength = ("factor",)

    @staticmethod
    def imu(
        p: SimpleNamespace, ahead: Scalar, left: Scalar, rate: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        return ahead, left, p.factor * rate


class ImuMisalignment(SensorEffect):
    """The IMU's axes are turned by `angle` about z (counter-clockwise) against the head's.

    measured = R(-angle) specific force; the rate about z is unchanged.
    """

    name = "imu_misalignment"
    equation = "measured specific force = R(-angle) specific force"
    source = "mounting error; strength is an assumption"
    parameters = {"angle": Parameter(0.0, "rad", -0.8, 0.8, source, typical=0.1)}
    strength = ("angle",)

    @staticmethod
    def imu(
        p: SimpleNamespace, ahead: Scalar, left: Scalar, rate: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        cos, sin = xp.cos(p.angle), xp.sin(p.angle)
        return cos * ahead + sin * left, cos * left - sin * ahead, rate


class ImuLatency(SensorEffect):
    """The reading stamped t is the fish's at t - delay, of all the IMU's values alike."""

    name = "imu_latency"
    equation = "IMU reading(t) is the fish's at t - delay"
    source = "filtering and transport of the IMU's readings; strength is an assumption"
    parameters = {"delay": Parameter(0.0, "s", 0.0, 0.5, source, typical=0.02)}
    strength = ("delay",)

    @staticmethod
    def imu_delay(p: SimpleNamespace) -> Scalar:
        return p.delay
