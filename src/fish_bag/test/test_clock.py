# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Clock offset and drift from arrival times, against clocks whose error is known."""

import numpy as np
import pytest

from fish_bag.time_axis import estimate_clock

EPOCH = 1_700_000_000_000_000_000


def observe(seed, offset, drift_ppm, duration=20.0, n=2000, scale=2e-3, shortest=0.8e-3):
    """Stamps and arrivals of messages whose latency is shortest + exponential(scale)."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0, duration, n))
    latency = shortest + rng.exponential(scale, n)
    stamp = EPOCH + np.round(t * 1e9).astype(np.int64)
    error = offset + drift_ppm * 1e-6 * (t - duration / 2)
    return stamp, stamp + round(offset) * 10**9 + np.round(
        (error - round(offset) + latency) * 1e9
    ).astype(np.int64)


def test_offset_and_drift_within_their_standard_errors():
    results = []
    for seed in range(60):
        clock = estimate_clock("c", ("a",), *observe(seed, offset=3.7, drift_ppm=40.0))
        results.append(
            (
                (clock.offset_s - 3.7 - 0.8e-3) / clock.offset_std_s,
                (clock.drift_ppm - 40) / clock.drift_std_ppm,
            )
        )
    within = np.mean(np.abs(results) < 2, axis=0)
    assert np.all(within > 0.8), f"covered within two standard errors: {within}"
    assert np.mean(np.abs(results) < 4) > 0.97


def test_error_shrinks_to_microseconds():
    clock = estimate_clock("c", ("a",), *observe(1, offset=-2329263.99, drift_ppm=-15.0, n=5000))
    assert clock.offset_s == pytest.approx(-2329263.99 + 0.8e-3, abs=5e-6)
    assert clock.drift_ppm == pytest.approx(-15, abs=2)
    assert clock.drift_is_significant


def test_single_early_messages_do_not_pull_the_envelope():
    stamp, arrival = observe(2, offset=0.0, drift_ppm=0.0)
    arrival[[0, 5]] -= 15_000_000
    clock = estimate_clock("c", ("a",), stamp, arrival)
    assert clock.offset_s == pytest.approx(0.8e-3, abs=5e-5)


def test_few_messages_give_no_uncertainty():
    stamp, arrival = observe(3, offset=1.0, drift_ppm=0.0, n=4)
    clock = estimate_clock("c", ("a",), stamp, arrival)
    assert clock.offset_s == pytest.approx(np.min(arrival - stamp) * 1e-9)
    assert np.isnan(clock.offset_std_s)
    assert not clock.drift_is_significant


@pytest.mark.parametrize("drift_ppm", [0.0, 80.0, -5e5])
def test_there_and_back(drift_ppm):
    stamp, arrival = observe(4, offset=12.5, drift_ppm=drift_ppm)
    clock = estimate_clock("c", ("a",), stamp, arrival)
    recorder = EPOCH + np.round(clock.to_recorder(stamp, EPOCH) * 1e9).astype(np.int64)
    np.testing.assert_allclose(
        clock.from_recorder(recorder, EPOCH), (stamp - EPOCH) * 1e-9, atol=1e-8
    )
