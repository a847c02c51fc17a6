# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensor noise from the signals' roughness: what the sensors were made with, whatever the fish does."""

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Headings
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.noise_estimation import (
    FEWEST,
    SMALLEST,
    usual_noise,
    white_noise,
)

SENSORS = ("gyro", "accel", "camera_position", "camera_heading", "encoder")


@pytest.fixture(scope="module", params=[1.0, 3.0])
def factor(request):
    return request.param


@pytest.fixture(scope="module")
def swum(factor):
    random, usual = np.random.default_rng(4), Noise()
    noisy = replace(usual, **{name: factor * getattr(usual, name) for name in SENSORS})
    commands = np.stack([program(kind, 10.0, random) for kind in ("sines", "random")], axis=1)
    return record(Robot(), commands, noisy, random)[0]


@pytest.mark.parametrize("sensor", SENSORS)
def test_noise_is_that_of_the_sensors(swum, factor, sensor):
    found = getattr(usual_noise(swum), sensor) / getattr(Noise(), sensor)
    assert found == pytest.approx(factor, rel=0.12)  # 600 poses


def test_a_smooth_signal_and_a_short_one():
    t = np.linspace(0.0, 5.0, 500)
    swing = 2.0 * np.sin(2.0 * np.pi * 2.0 * t)
    assert white_noise([(t, swing)], 0.006) == SMALLEST * 0.006
    assert white_noise([(t[:FEWEST], swing[:FEWEST])], 0.006) == 0.006
    assert white_noise([(t, np.full(500, np.nan))], 0.006) == 0.006


@pytest.mark.parametrize(("every", "expected"), [(2, 0.02), (5, 0.006)])
def test_a_slow_sensor_is_measured_as_long_as_it_follows_the_motion(every, expected):
    t, signal = 0.01 * np.arange(3000), np.full(3000, np.nan)
    signal[::every] = 0.02 * np.random.default_rng(5).standard_normal(3000 // every)
    assert white_noise([(t, signal)], 0.006) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("every", [1, 5])
def test_a_gyro_is_measured_fast_or_slow(swum, every):
    """A fast one by differences of its samples; one at 20 Hz by what the IMU's own orientation says of the turn."""
    random, t = np.random.default_rng(6), DT * np.arange(swum.length)
    kept = t[::every]
    gyro = np.full(swum.gyro.shape, np.nan)
    noise = 0.1 * random.standard_normal((len(kept), gyro.shape[1]))
    gyro[::every] = 0.6 * np.cos(2.0 * kept)[:, None] + noise
    turned = Headings(kept, 0.3 * np.sin(2.0 * kept))
    seen = replace(swum, gyro=gyro, headings=(turned,) * gyro.shape[1])
    assert usual_noise(seen).gyro == pytest.approx(0.1, rel=0.15)
