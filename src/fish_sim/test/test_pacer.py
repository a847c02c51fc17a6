# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pace of the simulation on made-up clocks."""

import numpy as np
import pytest

from fish_sim.nodes.pacing import MAX_LAG, Pacer


def run(factor, times):
    pacer = Pacer(factor, 0.01, 100.0)
    return [pacer.due(100.0 + t) for t in times], pacer


@pytest.mark.parametrize(("factor", "expected"), [(1.0, 100), (0.5, 50), (3.0, 300)])
def test_periods_follow_real_time_at_the_factor(factor, expected):
    counts, pacer = run(factor, [0.001 * k for k in range(1, 1001)])
    assert sum(counts) == expected
    assert max(counts) == 1
    assert pacer.lost == 0.0


def test_a_jittering_timer_neither_loses_nor_adds_periods():
    """A timer is late now and then, never early."""
    counts, pacer = run(1.0, [0.01 * k + (0.008 if k % 2 else 1e-5) for k in range(1, 101)])
    assert counts == [1] * 100
    assert pacer.lost == 0.0


@pytest.mark.parametrize("factor", [1.0, 0.5, 3.0])
def test_simulated_time_is_never_ahead_of_real_time(factor):
    """Stamps from the future look like a clock that is wrong: recordings would be moved by it."""
    random, pacer = np.random.default_rng(0), Pacer(factor, 0.01, 100.0)
    done, now = 0, 100.0
    for _ in range(1000):
        now += random.exponential(0.01)
        done += pacer.due(now)
        assert 0.01 * done <= (now - 100.0) * factor + 1e-7
    assert 0.01 * done > (now - 100.0) * factor - 0.02


def test_a_short_lag_is_caught_up_with():
    counts, pacer = run(1.0, [0.01, 0.11, 0.12])
    assert counts == [1, 10, 1]
    assert pacer.lost == 0.0


def test_a_long_lag_is_given_up_and_counted():
    counts, pacer = run(1.0, [0.01, 3.01, 3.02, 3.03])
    assert counts == [1, 0, 1, 1]
    assert pacer.lost == pytest.approx(3.0)
    assert MAX_LAG < 3.0


def test_what_is_given_up_is_counted_in_real_time():
    counts, pacer = run(3.0, [0.01, 1.01, 1.02])
    assert counts == [3, 0, 3]
    assert pacer.lost == pytest.approx(1.0)


def test_after_a_long_lag_simulated_time_goes_on_from_now():
    pacer = Pacer(1.0, 0.01, 100.0)
    assert pacer.due(103.0) == 0
    assert pacer.due(103.009) == 0
    assert pacer.due(103.0101) == 1


def test_factor_0_is_as_fast_as_possible():
    counts, _ = run(0.0, [0.0, 0.0, 1e-6, 100.0])
    assert counts == [1, 1, 1, 1]
