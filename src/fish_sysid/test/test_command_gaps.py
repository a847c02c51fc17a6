# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands that the recorder lost: what stands for them costs next to nothing, and what was not lost is held as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.commands import LostCommandsError, commands_on_grid, holes
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.parametrization import nominal_hypothesis

DT = 0.01
GRID = DT * np.arange(400)
TOLD = np.column_stack([60.0 * np.sin(4.0 * np.pi * GRID), 0.4 * np.sin(2.0 * GRID)])
SILENT = np.full(len(GRID), np.nan)
PEAK = 112  # the rotor's speed turns in the middle of the holes that begin here


def without(first: int, count: int) -> np.ndarray:
    return np.delete(np.arange(len(GRID)), np.arange(first, first + count))


@pytest.fixture(scope="module")
def swum() -> Experiment:
    random = np.random.default_rng(1)
    commands = np.stack([program(kind, 5.0, random) for kind in ("steps", "random")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def losing(swum: Experiment, first: int, count: int, measured: bool) -> Experiment:
    """The experiment with `count` commands lost in its first trial, and the encoder's samples of then if it does not measure."""
    given, encoder, grid = swum.commands.copy(), swum.encoder.copy(), DT * np.arange(swum.length)
    if not measured:
        encoder[first : first + count + 1, 0] = np.nan
    kept = np.delete(np.arange(swum.length), np.arange(first, first + count))
    given[:, 0], encoder[:, 0] = commands_on_grid(grid[kept], given[kept, 0], grid, encoder[:, 0])
    return replace(swum, commands=given, encoder=encoder)


@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("first", [200, 238])
def test_lost_commands_cost_next_to_nothing(
    swum: Experiment, first: int, count: int, measured: bool
) -> None:
    """At the truth; held they cost 5 lost messages thousands of nats."""
    hypothesis = nominal_hypothesis(Robot(), ())
    lost = losing(swum, first, count, measured)
    seen = np.isfinite(lost.encoder)  # what takes the command's place is no measurement
    whole = replace(swum, encoder=np.where(seen, swum.encoder, np.nan))
    full, found = (
        evaluate(hypothesis, np.zeros(0), e, Noise()).log_posterior for e in (whole, lost)
    )
    assert abs(full - found) < 8.0
    held = whole.commands.copy()
    held[first : first + count, 0] = held[first - 1, 0]
    cost = (
        full
        - evaluate(hypothesis, np.zeros(0), replace(whole, commands=held), Noise()).log_posterior
    )
    assert count == 1 or cost > 200.0


def test_without_the_encoder_a_curve_follows_the_strokes() -> None:
    for count, off in ((1, 0.05), (3, 0.1), (9, 1.0)):
        kept = without(PEAK - count // 2, count)
        given, encoder = commands_on_grid(GRID[kept], TOLD[kept], GRID, SILENT)
        assert np.abs(given[:, 0] - TOLD[:, 0]).max() < off
        assert np.abs(given[:, 1] - TOLD[:, 1]).max() < 0.004
        assert np.isnan(encoder).all()
        np.testing.assert_array_equal(given[kept], TOLD[kept])


def test_the_encoder_counts_where_it_measured_and_a_rudder_that_jumped_gets_a_line() -> None:
    kept, encoder = without(100, 6), np.full(len(GRID), 7.0)
    encoder[103] = np.nan  # tells of the command before it
    given = TOLD.copy()
    given[103:, 1] = 0.9
    found, left = commands_on_grid(GRID[kept], given[kept], GRID, encoder)
    assert found[[100, 101, 103, 104, 105], 0].tolist() == [7.0] * 5
    assert found[102, 0] == pytest.approx(TOLD[102, 0], abs=0.5)
    np.testing.assert_allclose(np.diff(found[99:107, 1]), (0.9 - given[99, 1]) / 7, atol=1e-12)
    assert np.isnan(left[101:107]).all()
    assert (left[[100, 107]] == 7.0).all()


def test_a_hole_at_either_end_has_fewer_commands_to_run_through() -> None:
    for first in (1, len(GRID) - 4):
        kept = without(first, 3)
        given, _ = commands_on_grid(GRID[kept], TOLD[kept], GRID, SILENT)
        assert np.abs(given[:, 0] - TOLD[:, 0]).max() < 2.0


def test_a_hole_that_is_too_long_is_said() -> None:
    commands_on_grid(GRID[(kept := without(200, 9))], TOLD[kept], GRID, SILENT)
    kept = without(200, 10)
    with pytest.raises(
        LostCommandsError,
        match=r"from 1\.99 to 2\.10 s, where one comes every 10 ms; .* cut .* or record",
    ):
        commands_on_grid(GRID[kept], TOLD[kept], GRID, SILENT)


def random_stamps(spread: float) -> np.ndarray:
    return np.cumsum(np.maximum(DT + spread * np.random.default_rng(0).standard_normal(500), 1e-3))


@pytest.mark.parametrize(
    "t",
    [
        np.cumsum(np.random.default_rng(1).exponential(0.03, 500)),  # on events
        random_stamps(0.004),  # late and early
        np.concatenate([GRID, 4.0 + 0.5 * np.arange(200)]),  # when something changes
        np.sort(
            np.concatenate([GRID[:200], GRID[200:] + 0.007])
        ),  # one that came late, and all after it
        GRID[:5],
    ],
)
def test_commands_that_do_not_come_on_a_beat_are_held(t: np.ndarray) -> None:
    assert holes(t) == []


def test_the_beat_may_be_another_than_the_grids_and_many_may_be_lost() -> None:
    assert holes(np.delete(0.02 * np.arange(200), [50, 51])) == [49]
    lost = np.arange(20, 380, 10)
    t = np.delete(GRID + 0.0003 * np.random.default_rng(0).standard_normal(len(GRID)), lost)
    assert len(holes(t)) == len(lost)
    given = np.delete(TOLD, lost, axis=0)
    found, _ = commands_on_grid(t, given, t[0] + DT * np.arange(len(GRID)), SILENT)
    np.testing.assert_allclose(found[lost, 0], TOLD[lost, 0], atol=2.0)
