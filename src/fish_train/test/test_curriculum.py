# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ladder of paths and what passes a level."""

import numpy as np
import pytest

from fish_train.training.config import make_config
from fish_train.training.curriculum import SlidingCriterion, make_levels


def test_sinusoids_and_circles_alternate_once_for_each_threshold() -> None:
    levels = make_levels(make_config({}))
    assert len(levels) == 24
    assert [level.family for level in levels[:4]] == ["sinusoid", "circle", "sinusoid", "circle"]
    assert [level.threshold for level in levels] == [0.03] * 12 + [0.01] * 12
    assert [level.size for level in levels[1:12:2]] == [1.5, 1.4, 1.3, 1.2, 1.1, 1.0]
    assert [(level.size, level.cycles) for level in levels[0:12:2]] == [
        (1.0, 0.5),
        (1.0, 1.0),
        (1.0, 2.0),
        (1.5, 0.5),
        (1.5, 1.0),
        (1.5, 2.0),
    ]


def test_paths_of_a_level_have_its_size() -> None:
    config = make_config({})
    levels, rng = make_levels(config), np.random.default_rng(1)
    waves = levels[4].paths(config, rng)
    assert len({round(float(path.heading_at(0.0)), 3) for path in waves}) > 4  # phases differ
    for path in waves:
        assert np.abs(path.points[:, 1]).max() == pytest.approx(levels[4].size, rel=1e-3)
    left, right = levels[1].paths(config, rng)
    assert np.median(left.curvature) == pytest.approx(1.0 / 1.5, rel=1e-3)
    assert np.median(right.curvature) == pytest.approx(-1.0 / 1.5, rel=1e-3)


def test_a_level_passes_on_a_full_window_below_its_threshold() -> None:
    criterion = SlidingCriterion(3)
    for value in (0.02, 0.02):
        criterion.add(value)
        assert not criterion.passed(0.03)  # the window is not full
    criterion.add(0.08)
    assert criterion.mean == pytest.approx(0.04)
    assert not criterion.passed(0.03)
    criterion.add(0.02)
    criterion.add(0.02)
    criterion.add(0.02)  # the bad episode has left the window
    assert criterion.passed(0.03)
