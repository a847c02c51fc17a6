# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Percentiles of delays."""

import pytest

from fish_control.latency import Latency


def test_percentiles_of_the_last_values():
    latency = Latency(size=101)
    for _ in range(1000):
        latency.add(100.0)
    for k in range(101):
        latency.add(k / 1000.0)
    assert latency.percentiles() == pytest.approx((0.05, 0.099))


def test_nothing_without_values():
    assert Latency().percentiles() is None
