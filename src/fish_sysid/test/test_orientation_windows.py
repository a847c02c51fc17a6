# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Turns by the IMU's orientation against those by its gyro."""

from dataclasses import replace

import numpy as np
import pytest
from kinematic_swims import World, kinematic_swims

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment, Headings
from fish_sysid.dataset.imu import WINDOW, orientation_windows
from fish_sysid.dataset.synthetic import with_gyro_scale


@pytest.fixture(scope="module")
def seen_by_both() -> Experiment:
    """A gyro that is read at 20 Hz, and an orientation of the same moments that has integrated at 100 Hz."""
    made = kinematic_swims(World(), 5, 2)
    headings = []
    gyro = np.full_like(made.gyro, np.nan)
    for m, steps in enumerate(made.steps):
        rate = made.gyro[:steps, m]
        turned = DT * (np.cumsum(rate) - 0.5 * rate)
        read = np.arange(0, steps, 5)
        gyro[read, m] = rate[read]
        headings.append(Headings(DT * read, 0.7 + turned[read]))
    return replace(made, gyro=gyro, headings=tuple(headings))


def test_equal_turns_leave_nothing(seen_by_both) -> None:
    rest, size = orientation_windows(seen_by_both, 0).T
    assert len(rest) == int((16.0 - WINDOW) / WINDOW)
    assert abs(rest @ size / (size @ size)) < 0.01


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_a_gyro_that_reads_too_much_shows_in_every_window(seen_by_both, factor) -> None:
    rest, size = orientation_windows(with_gyro_scale(seen_by_both, factor), 1).T
    assert 1.0 / (1.0 + rest / size) == pytest.approx(factor, abs=0.02)


def test_nobody_knows_how_it_turned_across_a_hole(seen_by_both) -> None:
    """A gyro that says nothing for a second in which the fish turned: the same scale, and nothing of that second."""
    torn = seen_by_both.gyro.copy()
    torn[600:700, 0] = np.nan
    rest, size = orientation_windows(replace(seen_by_both, gyro=torn), 0).T
    assert abs(rest @ size / (size @ size)) < 0.01


def test_without_an_orientation_there_is_nothing_to_compare(seen_by_both) -> None:
    assert orientation_windows(replace(seen_by_both, headings=()), 0).shape == (0, 2)
