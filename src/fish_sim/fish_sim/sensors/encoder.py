# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Encoder of the rotor's motor."""

from __future__ import annotations

from numpy.random import Generator

from fish_sim.sensors.settings import SensorSettings


class Encoder:
    """Angle [rad] and speed [rad/s] of the rotor with white noise."""

    def __init__(self, settings: SensorSettings, random: Generator) -> None:
        self._settings, self._random = settings, random

    def measure(self, angle: float, speed: float) -> tuple[float, float]:
        """(angle, speed) as the encoder sees them."""
        s, random = self._settings, self._random
        return (
            angle + random.normal(0.0, s.encoder_angle_noise),
            speed + random.normal(0.0, s.encoder_speed_noise),
        )
