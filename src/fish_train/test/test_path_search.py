# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search that training uses finds what fish_control's PathBatch finds."""

import numpy as np
import pytest

from fish_control.path_batch import PathBatch, TrackerConfig
from fish_control.paths import make_path
from fish_sim.ops import NUMPY
from fish_train.training.closed_loop_equations import path_ahead
from fish_train.training.path_bank import PathTable
from fish_train.training.path_search import locate

PATHS = {
    "letter": lambda: make_path("R"),
    "circle": lambda: make_path("circle", radius=0.6),
    "tight": lambda: make_path("circle", radius=0.15),  # never leaves the lookahead circle
    "closed once": lambda: make_path("circle", radius=0.4, end="stop"),
    "again": lambda: make_path("straight", length=0.8, end="loop"),
}


@pytest.mark.parametrize("name", PATHS)
def test_along_a_wandering_swim(name: str) -> None:
    path, tracker = PATHS[name](), TrackerConfig()
    table, batch = PathTable.of(path, tracker), PathBatch([path], tracker)
    place, rng = np.zeros(2), np.random.default_rng(8)
    offset = 0.3  # m, beyond the capture distance at first
    for s in np.linspace(-0.1, 2.2 * min(path.length, 3.0), 150):
        offset = 0.9 * offset + 0.01 * rng.standard_normal()
        heading = float(path.heading_at(s))
        position = path.point(s) + offset * np.array([-np.sin(heading), np.cos(heading)])
        expected = batch.update(position[None])
        ahead = path_ahead(
            *position, locate(table, tracker, place, position), tracker.lookahead, NUMPY
        )
        assert place[0] == pytest.approx(expected.progress[0], abs=1e-12)
        assert [ahead.x, ahead.y] == pytest.approx(expected.point[0], abs=1e-12)
        assert [ahead.target_x, ahead.target_y] == pytest.approx(expected.target[0], abs=1e-9)
        assert ahead.heading == pytest.approx(expected.heading[0], abs=1e-12)
        assert ahead.curvature == pytest.approx(expected.curvature[0], abs=1e-12)
        assert ahead.chord == pytest.approx(expected.chord[0], abs=1e-9)
