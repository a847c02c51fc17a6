# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Battery, temperature and fault limits."""

import math
from dataclasses import replace

import pytest

from fish_hw.devices.rotor_watch import RotorHealth
from fish_hw.devices.vertiq import RotorTelemetry
from fish_hw.settings import RotorSettings

SETTINGS = RotorSettings()  # 4 cells, warn 3.5, stop 3.3 V
WELL = RotorTelemetry(35.0, 40.0, 15.6, 0.5, 10.0, 0, 1.0, 1)


def test_well():
    health = RotorHealth(SETTINGS).judge(WELL, 0.0)
    assert (health.warnings, health.stops) == ((), ())


def test_battery_filter_is_a_first_order_lag():
    health = RotorHealth(SETTINGS)
    health.judge(WELL, 0.0)
    for i in range(1, 5):
        health.judge(replace(WELL, volts=12.6), SETTINGS.battery_filter_s / 4 * i)
    # one time constant after a step the rest is 1/e
    assert health.filtered_volts == pytest.approx(12.6 + (15.6 - 12.6) * 0.36788, abs=1e-3)


def test_sag_under_load_does_not_stop_but_an_empty_battery_does():
    health = RotorHealth(SETTINGS)
    health.judge(WELL, 0.0)
    for i in range(100):  # 4 Hz ripple of 2 V, asked at 10 Hz
        ripple = replace(WELL, volts=14.6 + math.sin(math.tau * 4.0 * 0.1 * i))
        assert not health.judge(ripple, 0.1 * i).stops
    stops = [health.judge(replace(WELL, volts=12.8), 10.0 + 0.1 * i).stops for i in range(30)]
    assert stops[-1] == ("battery at 3.20 V per cell",)
    assert next(i for i, stop in enumerate(stops) if stop) * 0.1 < 1.0


def test_a_peak_of_voltage_warns_and_a_high_battery_stops():
    health = RotorHealth(SETTINGS)
    assert not health.judge(replace(WELL, volts=4 * 4.4), 0.0).stops
    assert not health.judge(WELL, 0.1).stops
    assert not health.judge(replace(WELL, volts=4 * 4.4), 0.2).stops
    said = health.judge(replace(WELL, volts=4 * 4.4), 0.3).stops
    assert said == ("battery driven up to 4.40 V per cell",)


def test_battery_must_recover_above_the_warning():
    health = RotorHealth(replace(SETTINGS, battery_filter_s=0.0))
    assert health.judge(replace(WELL, volts=4 * 3.25), 0.0).stops
    assert health.judge(replace(WELL, volts=4 * 3.45), 1.0).stops  # relieved of the load
    assert not health.judge(replace(WELL, volts=4 * 3.55), 2.0).stops


def test_missing_answers_leave_the_judgement_as_it_was():
    health = RotorHealth(replace(SETTINGS, battery_filter_s=0.0))
    stopped = health.judge(replace(WELL, volts=4 * 3.2, coil_c=90.0), 0.0).stops
    assert len(stopped) == 2
    assert health.judge(RotorTelemetry(), 1.0).stops == stopped
    assert health.judge(RotorTelemetry(faults=0b10), 2.0).stops == (
        *stopped,
        "module faults: input voltage",
    )
    assert RotorHealth(SETTINGS).judge(RotorTelemetry(faults=0), 0.0).stops == ()


@pytest.mark.parametrize(
    ("change", "warning", "stop"),
    [
        ({"volts": 4 * 3.4}, "battery at 3.40 V", ""),
        ({"volts": 4 * 4.4}, "driven up to 4.40 V", ""),
        ({"coil_c": 75.0}, "coil at 75", ""),
        ({"controller_c": 90.0}, "", "controller at 90"),
        ({"derate": 0.6}, "60% of its power", ""),
        ({"faults": 0b1000001}, "", "logic supply low, coil temperature"),
    ],
)
def test_limits(change, warning, stop):
    health = RotorHealth(SETTINGS).judge(replace(WELL, **change), 0.0)
    assert warning in "".join(health.warnings)
    assert bool(warning) == bool(health.warnings)
    assert stop in "".join(health.stops)
    assert bool(stop) == bool(health.stops)
