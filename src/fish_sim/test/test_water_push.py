# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The water's random push: stationary from its first value, as strong and as lasting as it says."""

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.water_push import WaterPush


@pytest.mark.parametrize("water", [WaterPush.usual(2.0), WaterPush.of_force(0.002)])
def test_the_push_is_stationary_and_correlated_over_its_time(water: WaterPush) -> None:
    random = np.random.default_rng(0)
    first = water.first(random.standard_normal((4000, 3)))
    push = first
    for _ in range(round(water.time / DT)):
        push = water.after(push, random.standard_normal(push.shape))
    for wrench in (first, push):
        np.testing.assert_allclose(wrench.std(axis=0), water.size, rtol=0.05)
    correlation = (first * push).mean(axis=0) / (first.std(axis=0) * push.std(axis=0))
    np.testing.assert_allclose(correlation, np.exp(-1.0), atol=0.05)


def test_still_water_does_not_push() -> None:
    water = WaterPush.of_force(0.0)
    assert not water.after(water.first(np.ones(3)), np.ones(3)).any()


def test_without_fresh_numbers_the_push_decays_exponentially() -> None:
    water = WaterPush.usual()
    push = np.array([1.0, -2.0, 0.5])
    for _ in range(40):
        push = water.after(push, np.zeros(3))
    np.testing.assert_allclose(push, np.exp(-40 * DT / water.time) * np.array([1.0, -2.0, 0.5]))
