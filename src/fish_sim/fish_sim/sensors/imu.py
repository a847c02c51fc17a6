# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Inertial measurement unit at the head's centre of mass."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from fish_sim.sensors.settings import SensorSettings

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True)
class ImuSample:
    """Axes of imu_link (= base_link)."""

    yaw: float  # rad, game rotation vector: unknown constant offset, slow drift
    angular_velocity: NDArray[np.float64]  # (3,) rad/s
    specific_force: NDArray[np.float64]  # (3,) m/s^2


class Imu:
    """Adds constant biases, white noise and a drifting yaw offset.

    gyro = (0, 0, r) + b_g + n_g,   accelerometer = (a_x, a_y, g) + b_a + n_a,   yaw = psi + psi_0 + walk
    """

    def __init__(self, settings: SensorSettings, random: Generator, delay: float = 0.0) -> None:
        """delay: how much older a reading is than its stamp [s], to the nearest sample."""
        self._settings, self._random, self._delay = settings, random, delay
        self._felt: deque[tuple[tuple[float, float], float, float]] = deque()
        self.gyro_bias = random.normal(0.0, settings.gyro_bias, 3)
        self.accelerometer_bias = random.normal(0.0, settings.accelerometer_bias, 3)
        self._offset = random.uniform(-math.pi, math.pi)

    def measure(
        self, specific_force: tuple[float, float], rate: float, heading: float, dt: float
    ) -> ImuSample:
        """One sample, dt [s] after the last one; specific_force in base_link [m/s^2]."""
        s, random = self._settings, self._random
        self._felt.append((specific_force, rate, heading))
        while len(self._felt) > 1 + round(self._delay / dt):
            self._felt.popleft()
        specific_force, rate, heading = self._felt[0]
        self._offset += random.normal(0.0, s.orientation_drift * math.sqrt(dt))
        gyro = np.array([0.0, 0.0, rate]) + self.gyro_bias + random.normal(0.0, s.gyro_noise, 3)
        force = np.array([*specific_force, GRAVITY]) + self.accelerometer_bias
        yaw = heading + self._offset + random.normal(0.0, s.orientation_noise)
        return ImuSample(yaw, gyro, force + random.normal(0.0, s.accelerometer_noise, 3))
