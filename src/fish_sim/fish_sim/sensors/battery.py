# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Battery: voltage under the rotor's load."""

from __future__ import annotations

from numpy.random import Generator

from fish_sim.sensors.settings import SensorSettings

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
