# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a sensor may do to the truth, in the form of `effects.effect`: the sensor, not the fish."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, ClassVar

from fish_sim.ops import Scalar
from fish_sim.parameter import Parameter


class SensorEffect:
    """Base of all sensor effects: the true value. Subclasses override what they change.

    Methods are written on generic scalars (`xp` of `fish_sim.ops`).
    """

    name: ClassVar[str]
    kind: ClassVar[str] = "sensor"
    equation: ClassVar[str]
    source: ClassVar[str]
    parameters: ClassVar[Mapping[str, Parameter]]
    strength: ClassVar[
        tuple[str, ...]
    ]  # parameters whose default (zero or neutral) value means: effect off

    @staticmethod
    def pose_delay(p: SimpleNamespace) -> Scalar:
        """How much older the camera's image is than its stamp [s]."""
        return 0.0

    @staticmethod
    def imu_delay(p: SimpleNamespace) -> Scalar:
        """How much older the IMU's reading is than its stamp [s]."""
        return 0.0

    @staticmethod
    def pose(
        p: SimpleNamespace, x: Scalar, y: Scalar, heading: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        """Camera pose (x, y, heading) in the pool frame [m, m, rad]."""
        return x, y, heading

    @staticmethod
    def imu(
        p: SimpleNamespace, ahead: Scalar, left: Scalar, rate: Scalar, xp: Any
    ) -> tuple[Scalar, ...]:
        """Specific force along x and y of imu_link and rate about z [m/s^2, m/s^2, rad/s]."""
        return ahead, left, rate
