# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Battery, temperatures and faults of the rotor module: what to warn of and when to stop."""

import math
from dataclasses import dataclass, field

from fish_hw.devices.vertiq import RotorTelemetry
from fish_hw.devices.vertiq_registers import fault_names
from fish_hw.settings.rotor import RotorSettings

HIGH_ANSWERS = 2  # in a row with too high a voltage


@dataclass(frozen=True)
class Health:
    """Reasons to warn and reasons to stop, in words; both empty when all is well."""

    warnings: tuple[str, ...] = field(default=())
    stops: tuple[str, ...] = field(default=())


class RotorHealth:
    """Judges telemetry.

    The battery is judged by its filtered voltage, v += (1 - exp(-dt / battery_filter_s)) (v_measured - v):
    the load ripples at 4 Hz. Once it stopped the rotor it must recover above the warning level. Too high a voltage stops
    it when two answers in a row say so: a single one may be the peak of a braking rotor.
    """

    def __init__(self, settings: RotorSettings) -> None:
        self.filtered_volts = math.nan
        self._settings = settings
        self._known = RotorTelemetry()
        self._last_time = 0.0
        self._battery_stopped = False
        self._high = 0  # answers in a row

    def judge(self, telemetry: RotorTelemetry, now: float) -> Health:
        """Warnings and stops for the newest telemetry; now in s.

        Where answers are missing the older ones hold: a stop does not end because the module fell silent.
        """
        if telemetry.volts is not None:
            self._filter(telemetry.volts, now)
            high = telemetry.volts / self._settings.battery_cells > self._settings.cell_over_v
            self._high = self._high + 1 if high else 0
        telemetry = self._known = telemetry.completed(self._known)
        warnings: list[str] = []
        stops: list[str] = []
        if telemetry.volts is not None:
            self._judge_battery(telemetry.volts, warnings, stops)
        self._judge_temperature(telemetry, warnings, stops)
        if telemetry.derate is not None and telemetry.derate < 1.0:
            warnings.append(f"module gives {telemetry.derate:.0%} of its power")
        if telemetry.faults:
            stops.append("module faults: " + ", ".join(fault_names(telemetry.faults)))
        return Health(tuple(warnings), tuple(stops))

    def _filter(self, volts: float, now: float) -> None:
        tau = self._settings.battery_filter_s
        if math.isnan(self.filtered_volts) or tau == 0.0:
            self.filtered_volts = volts
        else:
            gain = 1.0 - math.exp(-(now - self._last_time) / tau)
            self.filtered_volts += gain * (volts - self.filtered_volts)
        self._last_time = now

    def _judge_battery(self, volts: float, warnings: list[str], stops: list[str]) -> None:
        settings = self._settings
        cell = self.filtered_volts / settings.battery_cells
        limit = settings.cell_warn_v if self._battery_stopped else settings.cell_stop_v
        self._battery_stopped = cell < limit
        if self._battery_stopped:
            stops.append(f"battery at {cell:.2f} V per cell")
        elif cell < settings.cell_warn_v:
            warnings.append(f"battery at {cell:.2f} V per cell")
        if self._high:
            found = stops if self._high >= HIGH_ANSWERS else warnings
            found.append(f"battery driven up to {volts / settings.battery_cells:.2f} V per cell")

    def _judge_temperature(
        self, telemetry: RotorTelemetry, warnings: list[str], stops: list[str]
    ) -> None:
        for name, value in (("controller", telemetry.controller_c), ("coil", telemetry.coil_c)):
            if value is None:
                continue
            if value > self._settings.temperature_stop_c:
                stops.append(f"{name} at {value:.0f} deg C")
            elif value > self._settings.temperature_warn_c:
                warnings.append(f"{name} at {value:.0f} deg C")
