# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""By how much an IMU's heading leads its gyro."""

import math

import numpy as np
import pytest

from fish_control.imu_heading import HeadingLead, against_gyro
from fish_control.offset_sums import ClockEstimate


def heading(t):
    return 0.2 * np.sin(4.0 * np.pi * t) * (1.0 + 0.3 * np.sin(0.7 * t)) + 0.3 * np.sin(0.8 * t)


def sampled(lead, seed=0, period=0.05, seconds=30.0, gain=1.0, memory=math.inf):
    """The estimate from samples of a heading that leads the gyro by `lead` s; gain: of the gyro."""
    rng, estimate = np.random.default_rng(seed), HeadingLead(0.1, memory)
    for t in np.cumsum(rng.uniform(0.6, 1.4, round(seconds / period)) * period):
        rate = (heading(t + 1e-4) - heading(t - 1e-4)) / 2e-4
        yaw = heading(t + lead) + rng.normal(0.0, 0.01)
        estimate.add(float(t), gain * rate + rng.normal(0.0, 0.1), float(yaw))
    return estimate


@pytest.mark.parametrize("lead", [-0.04, 0.0, 0.012, 0.05])
@pytest.mark.parametrize("gain", [1.0, 0.75])
def test_the_lead_is_found(lead, gain):
    found = sampled(lead, gain=gain).current
    assert found.sure
    assert found.offset == pytest.approx(lead, abs=0.004)


def test_errors_are_as_large_as_the_standard_deviation_says():
    found = [sampled(0.012, seed).current for seed in range(30)]
    ratios = np.array([(e.offset - 0.012) / e.std for e in found])
    assert 0.3 < np.sqrt(np.mean(ratios**2)) < 1.6


def test_a_lead_that_changes_is_followed_within_the_memory():
    estimate = HeadingLead(0.1, 5.0)
    for k in range(6000):
        t = 0.01 * k
        lead = 0.0 if t < 30.0 else 0.03
        estimate.add(
            t, float((heading(t + 1e-4) - heading(t - 1e-4)) / 2e-4), float(heading(t + lead))
        )
    assert estimate.current.offset == pytest.approx(0.03, abs=0.002)


def test_a_fish_at_rest_tells_no_lead():
    estimate, rng = HeadingLead(0.1), np.random.default_rng(1)
    for k in range(2000):
        estimate.add(0.01 * k, rng.normal(0.0, 0.006), rng.normal(0.0, 0.003))
    assert not estimate.current.sure


@pytest.mark.parametrize("gyro", ["absent", "in samples too far apart"])
def test_a_gyro_that_does_not_say_what_happened_tells_no_lead(gyro):
    estimate, period = HeadingLead(0.1), 0.01 if gyro == "absent" else 0.11
    for k in range(1000):
        t = period * k
        rate = None if gyro == "absent" else float((heading(t + 1e-4) - heading(t - 1e-4)) / 2e-4)
        estimate.add(t, rate, float(heading(t)))
    assert not estimate.current.sure


def test_the_offset_to_the_gyro_is_known_as_well_as_both_parts():
    to_gyro = against_gyro(ClockEstimate(-0.505, 0.003, True), ClockEstimate(0.012, 0.004, True))
    assert to_gyro.offset == pytest.approx(-0.493)
    assert to_gyro.std == pytest.approx(0.005)
    assert to_gyro.sure
    assert not against_gyro(ClockEstimate(0.0, 0.1, False), ClockEstimate(0.0, 0.001, True)).sure
