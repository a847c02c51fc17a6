# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tails of F statistics of few trials, and nulls of too few values."""

import numpy as np
import pytest
from scipy.stats import f as fisher

from fish_sysid.diagnosis.change.tail_probability import Tails, tail_probability

DEGREES = (1, 10)


def test_the_tail_of_an_f_statistic_is_found_beyond_its_largest_value() -> None:
    """300 values reach to 0.003; a probability of 0.0003 is found to be small, and never much too small."""
    random = np.random.default_rng(3)
    value = float(fisher.isf(3e-4, *DEGREES))
    found = np.array([tail_probability(random.f(*DEGREES, 300), value) for _ in range(40)])
    assert (found > 3e-4 / 6).all()
    assert (found < 0.02).all()
    assert np.exp(np.log(found).mean()) > 3e-4


def test_within_the_null_it_counts() -> None:
    null = np.arange(1.0, 101.0)
    assert tail_probability(null, 50.5) == pytest.approx(51 / 101)
    assert tail_probability(null, 0.5) == 1.0


def test_a_tail_is_never_lighter_than_the_median_one() -> None:
    random = np.random.default_rng(4)
    null = np.column_stack(
        [random.f(*DEGREES, 300), random.f(*DEGREES, 300), 1.0 + random.random(300)]
    )
    tails = Tails.of(null)
    assert tails.gamma.min() == np.median(tails.gamma)


def test_too_few_exchanged_sets_say_so() -> None:
    with pytest.raises(ValueError, match="null of 8 values"):
        tail_probability(np.ones(8), 2.0)
