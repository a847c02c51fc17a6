# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where a fish is on its path, in NumPy: what c/path_search.h does, for machines without a C compiler."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_control.path_batch import LOOKAHEAD_SEARCH, TrackerConfig
from fish_train.training.path_bank import PathTable

Array = NDArray[np.float64]


def locate(table: PathTable, tracker: TrackerConfig, place: Array, position: Array) -> Array:
    """Advance `place` (progress [m], captured) in place to a fish at `position` (2,) [m]; GEOMETRY_NAMES (15,).

    The samples that `PathBatch.update` finds: the nearest in the window ahead of the progress, and the segment on which
    the path ahead leaves the lookahead circle.
    """
    ds, start = table.spacing, place[0]
    if table.restarts and start >= table.lap_end - 1e-6:
        start, place[1] = 0.0, 0.0
    s = np.minimum(
        start + ds * np.arange(int(np.ceil(tracker.search_window / ds)) + 1), table.lap_end
    )
    squared = np.sum((_rows(table, s)[:, :2] - position) ** 2, axis=1)
    base = s[np.argmin(squared)]
    if squared.min() <= tracker.capture_distance**2:
        place[1] = 1.0
    lowest, highest = max(start - base, -ds), min(table.lap_end - base, ds)
    if not place[1]:
        base, lowest, highest = start, 0.0, 0.0
    (x, y), heading = _point(table, base)
    along = np.cos(heading) * (position[0] - x) + np.sin(heading) * (position[1] - y)
    place[0] = base + min(max(along, lowest), highest)
    row = _rows(table, place[0])
    before, after = _lookahead_segment(table, tracker.lookahead, place[0], position)
    shift = base - np.rint(place[0] / ds) * ds
    return np.array([x, y, heading, lowest, highest, *row, shift, *before, *after])


def _rows(table: PathTable, s: ArrayLike) -> Array:
    k = np.rint(np.asarray(s) / table.spacing).astype(np.int64)
    return table.rows[k % table.count if table.closed else np.minimum(k, len(table.rows) - 1)]


def _point(table: PathTable, s: float) -> tuple[tuple[float, float], float]:
    """Point and heading of the path between two samples."""
    x, y, heading, curvature, _ = _rows(table, s)
    delta = s - np.rint(s / table.spacing) * table.spacing
    mean = heading + 0.5 * curvature * delta
    return (x + delta * np.cos(mean), y + delta * np.sin(mean)), heading + curvature * delta


def _lookahead_segment(
    table: PathTable, lookahead: float, s: float, position: Array
) -> tuple[Array, Array]:
    """Ends of the segment that crosses the circle about the fish; at the farthest point of a path that stays inside."""
    ahead = s + table.spacing * np.arange(
        int(np.ceil(LOOKAHEAD_SEARCH * lookahead / table.spacing)) + 1
    )
    points = _rows(table, ahead)[:, :2]
    distance = np.linalg.norm(points - position, axis=1)
    leaves = distance >= lookahead
    first = int(np.argmax(leaves) if leaves.any() else np.argmax(distance))
    return points[max(first - 1, 0)], points[first]
