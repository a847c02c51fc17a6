# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reference paths as the tables that the kernel and the torch loop search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.path_batch import EXTENSION, LOOKAHEAD_SEARCH, TrackerConfig, leave_circle
from fish_control.reference_path import ReferencePath

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PathTable:
    """One path sampled for the search.

    Attributes:
        rows: (M, 5) x [m], y [m], heading [rad], curvature [1/m], chord [rad]; an open path with its continuation.
        spacing: arc length between rows [m]. count: rows of one lap. length: of the path [m].
        lap_end: arc length at which progress stops [m], infinite on a path that goes round.
        closed, restarts: what happens after the last row: go round, or begin anew.
    """

    rows: Array
    spacing: float
    count: int
    length: float
    lap_end: float
    closed: bool
    restarts: bool

    @classmethod
    def of(cls, path: ReferencePath, tracker: TrackerConfig) -> PathTable:
        """Sample a path; chord as `PathBatch` has it, for the same lookahead."""
        if tracker.lookahead_mode != "distance":
            raise ValueError(
                f"lookahead_mode: got {tracker.lookahead_mode!r}; training knows 'distance' only"
            )
        window = int(np.ceil(LOOKAHEAD_SEARCH * tracker.lookahead / path.spacing)) + 2
        rows = len(path.points) + (0 if path.closed else int(EXTENSION / path.spacing))
        s = path.spacing * np.arange(rows + window)
        points, heading = path.point(s), path.heading_at(s[:rows])
        view = np.lib.stride_tricks.sliding_window_view(points, window, axis=0)[:rows].swapaxes(
            1, 2
        )
        ahead = leave_circle(view, points[:rows], tracker.lookahead) - points[:rows]
        chord = np.angle(np.exp(1j * (np.arctan2(ahead[:, 1], ahead[:, 0]) - heading)))
        loops = path.end == "loop"
        return cls(
            rows=np.column_stack([points[:rows], heading, path.curvature_at(s[:rows]), chord]),
            spacing=path.spacing,
            count=len(path.points),
            length=path.length,
            lap_end=np.inf if path.closed and loops else path.length,
            closed=path.closed,
            restarts=not path.closed and loops,
        )


class PathBank:
    """A numbered collection of path tables."""

    def __init__(self, paths: Sequence[ReferencePath], tracker: TrackerConfig) -> None:
        self.paths = tuple(paths)
        self.tracker = tracker
        self.tables = tuple(PathTable.of(path, tracker) for path in paths)

    def __len__(self) -> int:
        return len(self.tables)
