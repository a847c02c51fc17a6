# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor's samples between the grid's times: a known signal, noise that stays white, gaps, other rates and rough stamps."""

import numpy as np
import pytest

from fish_sysid.dataset.grid import apart, on_grid

DT = 0.01
GRID = DT * np.arange(2000)


def strokes(t: np.ndarray) -> np.ndarray:
    """What an IMU feels of a fish: 2 Hz, with parts at its multiples."""
    return np.sin(4.0 * np.pi * t) + 0.3 * np.cos(12.0 * np.pi * t) + 0.1 * np.sin(30.0 * np.pi * t)


@pytest.mark.parametrize(
    ("phase", "rate"), [(0.004, 100.0), (0.005, 100.0), (0.0, 99.3), (0.001, 400.0), (0.002, 50.0)]
)
def test_a_clock_of_its_own_moves_no_signal(phase: float, rate: float) -> None:
    t = np.arange(phase, GRID[-1], 1.0 / rate)
    found = on_grid(t, strokes(t), GRID, DT)
    seen = np.isfinite(found)
    assert seen.sum() == pytest.approx(
        min(len(t), len(GRID)), abs=15
    )  # no more values than there were samples
    assert np.abs(found - strokes(GRID))[seen].max() < (0.03 if rate < 100.0 else 0.003)


def test_samples_on_the_grid_are_taken_as_they_are_and_missing_ones_stay_missing() -> None:
    kept = np.random.default_rng(0).random(len(GRID)) > 0.2
    noise = np.random.default_rng(1).standard_normal((len(GRID), 2))
    found = on_grid(GRID[kept] + 1e-9, noise[kept], GRID, DT)
    np.testing.assert_allclose(found[kept], noise[kept], atol=1e-4)
    assert np.isnan(found[~kept]).all()


def test_noise_stays_white_enough() -> None:
    """Half-way between samples, where it is worst: a straight line has 0.5 of the variance and neighbours that go together."""
    noise = np.random.default_rng(2).standard_normal(len(GRID))
    found = on_grid(GRID + 0.5 * DT, noise, GRID, DT)[1:-1]
    assert found.var() > 0.78
    assert np.mean(found[1:] * found[:-1]) / found.var() < 0.25


def test_nothing_is_made_up_in_a_gap_or_beyond_the_ends() -> None:
    t = np.concatenate([np.arange(1.003, 4.0, DT), np.arange(6.003, 9.0, DT)])
    seen = GRID[np.isfinite(on_grid(t, strokes(t), GRID, DT))]
    assert seen.min() == pytest.approx(1.01)
    assert seen.max() == pytest.approx(8.99)
    assert not ((seen > 4.0) & (seen < 6.0)).any()
    assert np.isnan(on_grid(np.zeros(0), np.zeros((0, 2)), GRID, DT)).all()


def test_stamps_close_together_or_twice_throw_nothing_off() -> None:
    t = np.sort(np.concatenate([GRID + 0.003, GRID[::50] + 0.0031, GRID[7::50] + 0.003]))
    noisy = strokes(t) + 0.05 * np.random.default_rng(3).standard_normal(len(t))
    found = on_grid(t, noisy, GRID, DT)
    assert np.nanmax(np.abs(found - strokes(GRID))) < 0.3
    assert np.isnan(
        on_grid(np.array([0.502]), np.array([7.0]), GRID, DT)
    ).all()  # one sample has no slope


def test_faster_samples_than_the_grids_are_thinned_and_others_all_kept() -> None:
    random = np.random.default_rng(4)
    for rate in (11.0, 30.0, 60.0, 100.0, 100.0 * (1.0 + 5e-5)):
        t = 0.005 + np.arange(500) / rate
        assert len(apart(t, DT)) >= 499
        assert len(apart(t + 1e-9 * random.standard_normal(500), DT)) >= 499
    for rate in (120.0, 240.0, 1000.0):
        t = np.sort(np.arange(500) / rate + 1e-3 * random.standard_normal(500))
        kept = t[apart(t, DT)]
        assert np.diff(kept).min() > 0.95 * DT - 1e-12
        slots = np.maximum.accumulate(kept - DT * np.arange(len(kept))) + DT * np.arange(len(kept))
        assert (
            slots - kept
        ).max() <= 0.05 * DT + 1e-12  # a grid point each, wherever the grid begins
    assert len(apart(np.zeros(0), DT)) == 0
