# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A batch of fish in the closed loop: their state between two windows, and the paths that they follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_control.line_of_sight import GuidanceState
from fish_control.path_batch import EXTENSION, LOOKAHEAD_SEARCH, TrackerConfig, leave_circle
from fish_control.reference_path import ReferencePath
from fish_train.training.closed_loop_equations import PHYSICS_STEPS, SIZES

Array = NDArray[np.float64]
HISTORY = 32  # physics steps of 10 ms kept for delayed vision
LONGEST_DELAY = HISTORY - PHYSICS_STEPS + 1
# memory of the guidance before the first period; all else starts at zero
START = GuidanceState().flat
MEMORY_SIZE = SIZES["guidance"] + SIZES["control"] + SIZES["actuator"] + SIZES["last"]


@dataclass
class BatchState:
    """B fish between two windows; arrays are C-contiguous and are written in place.

    Attributes:
        plant: (B, NS) simulator states. memory: (B, MEMORY_SIZE) guidance, control, actuators, last gains and
            set-point.
        place: (B, 4) progress [m] and captured flag, of the path as seen and of the true one.
        history: (B, HISTORY, 6) past motions, newest last.
        parameters: (B, NP) of the robots. path: (B,) numbers in the bank. speed: (B,) wanted surge [m/s].
        delay: (B,) physics steps (10 ms) by which what is seen is old; at most LONGEST_DELAY.
    """

    plant: Array
    memory: Array
    place: Array
    history: Array
    parameters: Array
    path: NDArray[np.int64]
    speed: Array
    delay: NDArray[np.int64]

    @classmethod
    def at(
        cls,
        plant: Array,
        parameters: Array,
        path: NDArray[np.int64],
        speed: Array,
        motion: Array,
        delay: NDArray[np.int64] | None = None,
    ) -> BatchState:
        """Fish that start an episode: controllers reset, what they see now was true all the time (`motion` (B, 6))."""
        batch = len(plant)
        return cls(
            plant=np.array(plant, dtype=float, order="C"),
            memory=np.repeat([[*START, *np.zeros(MEMORY_SIZE - len(START))]], batch, axis=0),
            place=np.zeros((batch, 4)),
            history=np.repeat(np.asarray(motion, dtype=float)[:, None], HISTORY, axis=1).copy(),
            parameters=np.ascontiguousarray(
                np.broadcast_to(parameters, (batch, np.shape(parameters)[-1])), float
            ),
            path=np.asarray(path, dtype=np.int64),
            speed=np.asarray(speed, dtype=float),
            delay=np.zeros(batch, dtype=np.int64)
            if delay is None
            else np.asarray(delay, dtype=np.int64),
        )

    def __len__(self) -> int:
        return len(self.plant)

    def copy(self) -> BatchState:
        """An independent copy."""
        return BatchState(**{name: value.copy() for name, value in vars(self).items()})


def check_hold(steps: int, hold: int) -> None:
    """A window is a whole number of policy decisions."""
    if hold < 1 or steps < 1 or steps % hold:
        raise ValueError(f"hold: got {hold} for a window of {steps} periods; expected a divisor")


@dataclass(frozen=True)
class WindowResult:
    """What a window of T periods cost and showed.

    Attributes:
        cost: mean stage cost over periods and fish. gradient: (W,) its derivative in the flat weights, or None.
        report: (T + 1, B, 3) true cross-track [m], heading [rad] and speed error [m/s] at the start of each period and
            at the end. applied: (T, B, 8) gains and set-point of each period.
    """

    cost: float
    gradient: Array | None
    report: Array
    applied: Array


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
