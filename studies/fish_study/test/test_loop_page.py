# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How much of the gap each model closes, and how sure that is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_study.loop_page import (
    gap_share,
    loop_figure,
    loop_table,
    speed_table,
)
from fish_train.evaluation.cells import Cell
from fish_train.evaluation.follow import ErrorSizes, RunMetrics
from fish_train.evaluation.study import Row

CELL = Cell("S", 0.1, 1)


def row(name: str, cross_track: float, speed: float = 0.02, cell: Cell = CELL) -> Row:
    sizes = ErrorSizes(cross_track, *(0.0,) * 4, speed, *(0.0,) * 4)
    return Row(name, "second plant", cell, RunMetrics(sizes, sizes, 1.0, ""))


def test_the_gap_is_shared_out_by_hand() -> None:
    errors = {"nominal": (0.03, 0.02), "corrected": (0.014, 0.02), "true": (0.01, 0.02)}
    rows = [row(name, *sizes) for name, sizes in errors.items()]
    table = loop_table(rows)
    assert [r[2] for r in table.rows] == ["0%", "80%", "100%"]
    assert table.rows[1][4] == "no gap"
    assert [r[1] for r in table.rows] == ["30.0", "14.0", "10.0"]  # mm
    lost = replace(rows[1], metrics=replace(rows[1].metrics, failure="left the pool"))
    assert [r[6] for r in loop_table([rows[0], lost, rows[2]]).rows] == [
        "0 of 1",
        "1 of 1",
        "0 of 1",
    ]
    assert [box.y[0] for box in loop_figure(rows).data] == pytest.approx([30.0, 14.0, 10.0])


def test_a_run_that_diverges_is_no_gap_that_is_missing() -> None:
    rows = [
        row(name, size, size)
        for name, size in {"nominal": 0.03, "corrected": np.nan, "true": 0.01}.items()
    ]
    assert [r[2] for r in loop_table(rows).rows] == ["0%", "unknown: a run diverged", "100%"]
    rows = [
        replace(rows[0]),
        replace(rows[2], candidate="corrected"),
        replace(rows[1], candidate="true"),
    ]
    assert {r[2] for r in loop_table(rows).rows} == {"unknown: a run diverged"}


def test_every_speed_has_a_gap_of_its_own() -> None:
    slow = {"nominal": 0.05, "corrected": 0.05, "true": 0.04}
    fast = {"nominal": 0.03, "corrected": 0.012, "true": 0.01}
    rows = [row(n, size, cell=Cell("S", 0.1, 1)) for n, size in slow.items()]
    rows += [row(n, size, cell=Cell("S", 0.15, 1)) for n, size in fast.items()]
    table = speed_table(rows)
    assert table.header[1::2] == ["0.1 m/s: mm", "0.15 m/s: mm"]
    assert table.rows[1] == ["corrected", "50.0", "0%", "12.0", "90%"]


def test_the_interval_of_a_share_is_as_wide_as_runs_differ() -> None:
    random = np.random.default_rng(3)
    water = random.normal(0.0, 0.02, 24)  # common to the runs of a cell, so it drops out
    nominal, true = 0.08 + water[None], 0.05 + water[None]
    calm = gap_share(nominal, 0.056 + water[None], true)
    assert calm == pytest.approx((0.8, 0.8, 0.8), abs=1e-6)
    share, low, high = gap_share(nominal, 0.056 + water + random.normal(0.0, 0.01, (1, 24)), true)
    assert low < 0.8 < high
    assert low < share < high
    assert 0.1 < high - low < 0.6  # 4 standard errors of 0.01 / sqrt(24) / 0.03: 0.27
    assert np.isnan(gap_share(true, nominal, nominal)[0])
    unsure = np.array([[0.10, 0.01] * 12])  # a gap of 0.005 that other runs may not have
    assert gap_share(unsure, np.zeros((1, 24)), np.full((1, 24), 0.05))[1:] == (-np.inf, np.inf)


@pytest.mark.parametrize(("trainings", "runs"), [(6.0, 1.0), (6.0, 5.0), (3.0, 10.0)])
def test_the_interval_of_a_share_holds_what_it_says(trainings: float, runs: float) -> None:
    """Of three trainings and 24 runs, with these standard deviations in mm; resampling them covered 77 to 95 %."""
    random = np.random.default_rng(1)

    def swum(mean: float, count: int, scatter: float) -> np.ndarray:
        return (
            mean
            + water
            + random.normal(0.0, scatter, (count, 1))
            + random.normal(0.0, runs, (count, 24))
        )

    share, hits = 0.9, 0
    for _ in range(600):
        water = random.normal(0.0, 20.0, 24)
        models = (
            swum(73.0, 3, trainings),
            swum(73.0 - 26.0 * share, 3, trainings),
            swum(47.0, 1, 0.0),
        )
        _, low, high = gap_share(*models)
        hits += low <= share <= high
    assert hits / 600 >= 0.94


def test_trainings_that_differ_widen_the_interval_and_all_count() -> None:
    nominal, true = np.full((3, 12), 0.08), np.full((1, 12), 0.05)
    own = np.array([0.05, 0.056, 0.062])[:, None] + np.zeros(12)
    share, low, high = gap_share(nominal, own, true)
    wide = 4.303 * 0.006 / np.sqrt(3.0) / 0.03  # t of two degrees of freedom
    assert (share, low, high) == pytest.approx((0.8, 0.8 - wide, 0.8 + wide), abs=1e-3)
    cells = [Cell("S", 0.1, seed) for seed in (1, 2)]
    rows = [
        row(n, size, cell=c)
        for n, sizes in {
            "nominal": (0.05, 0.05),
            "corrected": (0.02, 0.04),
            "true": (0.03,),
        }.items()
        for size in sizes
        for c in cells
    ]
    table = loop_table(rows)
    assert [r[1] for r in table.rows] == ["50.0", "30.0", "30.0"]
    assert table.rows[1][2].startswith("100% (")
    assert [r[5] for r in table.rows] == ["50.0, 50.0", "20.0, 40.0", "30.0"]
    assert [r[6] for r in table.rows] == ["0 of 4", "0 of 4", "0 of 2"]
    rows = [
        row(n, size, cell=c)
        for n, sizes in {
            "nominal": (0.05, 0.02),
            "corrected": (0.02, 0.04),
            "true": (0.03,),
        }.items()
        for size in sizes
        for c in cells
    ]
    assert [r[2] for r in loop_table(rows).rows] == ["0%", "100% (anything: no sure gap)", "100%"]
