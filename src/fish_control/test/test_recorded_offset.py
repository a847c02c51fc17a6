# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera's offset from a whole recording."""

import numpy as np
import pytest

from fish_control.offset_sums import ClockEstimate
from fish_control.recorded_offset import pooled, recorded_offset


def heading(t):
    swing = 0.2 * np.sin(4.0 * np.pi * t) * (1.0 + 0.3 * np.sin(0.7 * t))
    return np.where(t > 2.0, swing + 0.3 * np.sin(0.8 * t), 0.0)


def swum(seed, late, latency=0.1, seconds=40.0, still=False):
    rng = np.random.default_rng(seed)
    imu = np.arange(0.0, seconds, 0.01)
    exposed = np.arange(0.0, seconds, 1.0 / 30.0)
    true = (lambda t: 0.0 * t) if still else heading
    seen = true(exposed) + rng.normal(0.0, 0.012, len(exposed))
    latencies = np.full(len(exposed), latency - late)
    return exposed + late, seen, latencies, imu, true(imu) + 1.0


@pytest.mark.parametrize("late", [-1.0, 0.0, 0.05, 0.49, 20.0])
def test_the_offset_and_the_age_are_found(late):
    found = recorded_offset(*swum(1, late, latency=0.6))
    assert found.estimate.sure
    assert found.estimate.offset == pytest.approx(-late, abs=0.003)
    assert found.age == pytest.approx(0.6, abs=0.003)
    assert len(found.blocks) >= 6


def test_errors_are_as_large_as_the_standard_deviation_says():
    found = [recorded_offset(*swum(seed, 0.2)).estimate for seed in range(30)]
    ratios = np.array([(e.offset + 0.2) / e.std for e in found])
    assert 0.3 < np.sqrt(np.mean(ratios**2)) < 1.6


def test_a_fish_at_rest_is_not_sure():
    assert not recorded_offset(*swum(1, 0.1, still=True)).estimate.sure


def test_sensors_that_do_not_overlap_are_refused():
    camera, seen, latencies, imu, yaw = swum(1, 0.0)
    with pytest.raises(ValueError, match="do not overlap"):
        recorded_offset(camera, seen, latencies, imu + 500.0, yaw)
    with pytest.raises(ValueError, match="0 camera poses"):
        recorded_offset(camera[:0], seen[:0], latencies[:0], imu, yaw)


@pytest.mark.parametrize("between", [0.0, 0.01])
def test_pooled_offsets_say_how_much_the_recordings_differ(between):
    rng, stds, errors, found = np.random.default_rng(5), np.linspace(0.002, 0.006, 12), [], []
    for _ in range(200):
        own = -0.5 + rng.normal(0.0, between, 12) + rng.normal(0.0, stds)
        mean = pooled([ClockEstimate(o, s, True) for o, s in zip(own, stds, strict=True)])
        errors.append((mean.offset + 0.5) / mean.std)
        found.append(mean.between)
    assert 0.85 < np.std(errors) < 1.2
    assert np.mean(found) == pytest.approx(between, abs=0.0015)


def test_one_recording_stands_for_itself():
    assert pooled([ClockEstimate(-0.3, 0.004, True)]) == pytest.approx((-0.3, 0.004, 0.0))
