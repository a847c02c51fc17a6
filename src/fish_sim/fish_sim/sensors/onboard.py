# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensors on board: IMU at the head's centre of mass, encoder of the rotor's motor, voltage of the battery."""

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


# V, fall of the open-circuit voltage from full to empty, three LiPo cells; assumption
BATTERY_DROP = 2.0
IDLE_CURRENT = 0.6  # A, computer and sensors; assumption
EFFICIENCY = 0.5  # electrical to mechanical power; assumption
SMOOTHING = 1.0  # s, the voltage is averaged so that it does not show the rotor's stroke


class Battery:
    """Open-circuit voltage falls with the charge used, terminal voltage with the current.

    V = V_full - BATTERY_DROP Q / capacity - R I,   I = IDLE + |P| / (EFFICIENCY V_full)
    """

    def __init__(self, settings: SensorSettings, random: Generator) -> None:
        self._settings, self._random = settings, random
        self._charge = 0.0  # A s used
        self._current = IDLE_CURRENT

    def draw(self, power: float, dt: float) -> None:
        """Feed the rotor with a mechanical power [W] for dt [s]."""
        current = IDLE_CURRENT + abs(power) / (EFFICIENCY * self._settings.battery_voltage)
        self._current += dt / (SMOOTHING + dt) * (current - self._current)
        self._charge += current * dt

    def measure(self) -> float:
        """Terminal voltage [V]."""
        s = self._settings
        used = self._charge / (3600.0 * s.battery_capacity)
        voltage = s.battery_voltage - BATTERY_DROP * used - s.battery_resistance * self._current
        return max(0.0, voltage + self._random.normal(0.0, s.battery_noise))
