# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many robots on many paths: progress, cross-track error and lookahead points, vectorised.

The one implementation of path following; `PathTracker` is a batch of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_control.reference_path import SAMPLE_SPACING, PathError, ReferencePath

Array = NDArray[np.float64]
LookaheadMode = Literal["distance", "along"]
LOOKAHEAD_SEARCH = 2.5  # lookaheads of arc length in which the target point is searched
EXTENSION = 1.5  # m, straight continuation of an open path beyond its end, for lookahead points


@dataclass(frozen=True)
class TrackerConfig:
    """How progress is kept and the target chosen."""

    lookahead: float = 0.4  # m, the paper's distance from the robot to the target point
    lookahead_mode: LookaheadMode = (
        "distance"  # from the robot (as in the paper), or along the path
    )
    search_window: float = 0.3  # m ahead of the progress in which the nearest point is searched
    capture_distance: float = (
        0.25  # m, progress starts when the robot first comes this close to the path
    )

    def __post_init__(self) -> None:
        for name in ("lookahead", "search_window", "capture_distance"):
            value = getattr(self, name)
            if not (np.isfinite(value) and SAMPLE_SPACING < value <= 2.0):
                raise ValueError(
                    f"{name} is {value!r} m, expected {SAMPLE_SPACING} < {name} <= 2.0"
                )
        if self.lookahead_mode not in get_args(LookaheadMode):
            raise ValueError(
                f"lookahead_mode is {self.lookahead_mode!r}; known: {', '.join(get_args(LookaheadMode))}"
            )


@dataclass(frozen=True)
class PathState:
    """Where a batch of B robots is relative to its paths.

    Attributes:
        progress: (B,) arc length along the path [m]; on a closed looping path it keeps growing with each lap,
            on an open looping one it starts at 0 again.
        cross_track_error: (B,) signed distance to the path at `progress` [m], positive when the robot is left
            of it.
        point: (B, 2) the path there [m]. heading: (B,) course of the path there [rad]. curvature: (B,) [1/m].
        target: (B, 2) lookahead point [m].
        chord: (B,) direction of the lookahead point of a robot that is exactly on the path, relative to
            `heading` [rad]: what the path's own curvature contributes to the direction of `target`.
        finished: (B,) whether the end of a path that stops has been passed.
    """

    progress: Array
    cross_track_error: Array
    point: Array
    heading: Array
    curvature: Array
    target: Array
    chord: Array
    finished: NDArray[np.bool_]


class PathBatch:
    """Follows B paths in order: the nearest point is searched only in a window ahead of the progress."""

    def __init__(self, paths: Sequence[ReferencePath], config: TrackerConfig | None = None) -> None:
        self.config = config or TrackerConfig()
        self.paths = tuple(paths)
        tables = [_table(path, self.config) for path in self.paths]
        rows = max(len(table) for table in tables)
        self._table = np.stack(
            [np.pad(table, ((0, rows - len(table)), (0, 0)), mode="edge") for table in tables]
        )
        self._points = np.ascontiguousarray(self._table[:, :, :2])
        self._count = np.array([len(path.points) for path in self.paths])
        self._last = np.array([len(table) - 1 for table in tables])
        self._ds = np.array([path.spacing for path in self.paths])
        self._length = np.array([path.length for path in self.paths])
        self._closed = np.array([path.closed for path in self.paths])
        self._all_closed, self._any_closed = self._closed.all(), self._closed.any()
        loops = np.array([path.end == "loop" for path in self.paths])
        self._lap_end = np.where(self._closed & loops, np.inf, self._length)
        self._restarts = ~self._closed & loops
        self._row = np.arange(len(self.paths))
        self._window = self._ahead(self.config.search_window)
        self._lookahead = self._ahead(LOOKAHEAD_SEARCH * self.config.lookahead)
        self.progress = np.zeros(len(self.paths))
        self._captured = np.zeros(len(self.paths), dtype=bool)

    def reset(self, progress: ArrayLike = 0.0) -> None:
        """Forget the robots; follow the paths from `progress` [m] on (a number, or one for each path)."""
        progress = np.broadcast_to(np.asarray(progress, dtype=float), self.progress.shape)
        if not np.all(np.isfinite(progress) & (progress >= 0.0)):
            raise PathError(f"progress is {progress}, expected finite numbers >= 0")
        self.progress = progress.copy()
        self._captured[:] = False

    def nearest(self, position: ArrayLike, start: ArrayLike = 0.0) -> Array:
        """Progress [m] of the globally nearest point not before `start`: (B, 2) positions -> (B,).

        For starting on a closed path or resuming only; following uses `update`.
        """
        position = np.asarray(position, dtype=float)
        squared = _squared(self._points - position[:, None, :])
        index = np.arange(squared.shape[1])
        usable = (index < self._count[:, None]) & (
            index * self._ds[:, None] >= np.broadcast_to(start, self._row.shape)[:, None]
        )
        s: Array = np.argmin(np.where(usable, squared, np.inf), axis=1) * self._ds
        return s

    def update(self, position: ArrayLike) -> PathState:
        """Advance the progress to robots at `position` (B, 2) [m] and give errors and targets."""
        position = np.asarray(position, dtype=float)
        self._advance(position)
        at = self._evaluate(self.progress)
        offset = position - at.point
        e = -np.sin(at.heading) * offset[:, 0] + np.cos(at.heading) * offset[:, 1]
        finished = (self.progress >= self._lap_end - 1e-6) & ~self._restarts
        target = self._target(position)
        return PathState(
            self.progress.copy(), e, at.point, at.heading, at.curvature, target, at.chord, finished
        )

    def _advance(self, position: Array) -> None:
        """Move the progress to the nearest point of its window, once the robot has reached the path."""
        again = self._restarts & (self.progress >= self._lap_end - 1e-6)
        s0 = np.where(again, 0.0, self.progress)
        self._captured &= ~again
        s = np.minimum(s0[:, None] + self._window, self._lap_end[:, None])
        squared = _squared(self._points[self._row[:, None], self._index(s)] - position[:, None, :])
        best = squared.argmin(axis=1)
        distance = np.sqrt(squared[self._row, best])
        self._captured |= distance <= self.config.capture_distance
        chosen = s[self._row, best]
        chosen = _within(chosen + self._along_offset(chosen, position), s0, self._lap_end)
        self.progress = np.where(self._captured, chosen, s0)

    def _along_offset(self, s: Array, position: Array) -> Array:
        """Distance [m] along the tangent at s to the foot of the perpendicular, at most one sample."""
        at = self._evaluate(s)
        offset = position - at.point
        along = np.cos(at.heading) * offset[:, 0] + np.sin(at.heading) * offset[:, 1]
        return _within(along, -self._ds, self._ds)

    def _target(self, position: Array) -> Array:
        """Lookahead point: where the path ahead leaves a circle about the robot, or a fixed arc length ahead.

        A robot farther from the path than the lookahead aims at the path point at its progress. A path that
        stays within the circle (curved tighter than it) gives its farthest point on the next 2.5 lookaheads.
        """
        L = self.config.lookahead
        if self.config.lookahead_mode == "along":
            return self._evaluate(self.progress + L).point
        k = self._index(self.progress[:, None] + self._lookahead)
        return leave_circle(self._points[self._row[:, None], k], position, L)

    def _ahead(self, length: float) -> Array:
        """Arc lengths (B, K) [m] of the samples up to `length` [m] ahead."""
        ahead: Array = np.arange(int(np.ceil(length / self._ds.min())) + 1) * self._ds[:, None]
        return ahead

    def _index(self, s: Array) -> NDArray[np.int64]:
        """Table rows next to arc lengths s (B, K) [m]."""
        index: NDArray[np.int64] = np.rint(s / self._ds[:, None]).astype(np.int64)
        if self._all_closed:
            index = index % self._count[:, None]
        elif self._any_closed:
            around = index % self._count[:, None]
            index = np.where(self._closed[:, None], around, np.minimum(index, self._last[:, None]))
        else:
            index = np.minimum(index, self._last[:, None])
        return index

    def _evaluate(self, s: Array) -> _PathSample:
        """The path at arc lengths s (B,)."""
        x, y, heading, curvature, chord = self._table[self._row, self._index(s[:, None])[:, 0]].T
        delta = s - np.rint(s / self._ds) * self._ds
        turned = curvature * delta
        mean = heading + 0.5 * turned
        point = np.array((x + delta * np.cos(mean), y + delta * np.sin(mean))).T
        return _PathSample(point, heading + turned, curvature, chord)


@dataclass(frozen=True)
class _PathSample:
    point: Array  # (B, 2) m
    heading: Array  # (B,) rad
    curvature: Array  # (B,) 1/m
    chord: Array  # (B,) rad


def leave_circle(ahead: Array, centre: Array, radius: float) -> Array:
    """First point where polylines leave circles; the farthest point of one that does not.

    Args:
        ahead: (B, K, 2) points along each path [m]; centre: (B, 2) [m]; radius [m].

    Returns:
        (B, 2) [m]; the first point where the polyline starts outside.
    """
    distance = np.sqrt(_squared(ahead - centre[:, None, :]))
    leaves = distance >= radius
    first = np.where(leaves.any(axis=1), leaves.argmax(axis=1), distance.argmax(axis=1))
    before = np.maximum(first - 1, 0)
    row = np.arange(len(ahead))
    d0, d1 = distance[row, before], distance[row, first]
    share = np.divide(radius - d0, d1 - d0, out=np.ones(d0.shape), where=d1 > d0)
    share = _within(share, 0.0, 1.0)
    inside, outside = ahead[row, before], ahead[row, first]
    point: Array = inside + share[:, None] * (outside - inside)
    return point


def _squared(vectors: Array) -> Array:
    """Squared lengths (...) of vectors (..., 2)."""
    x, y = vectors[..., 0], vectors[..., 1]
    length: Array = x * x + y * y
    return length


def _within(values: Array, low: ArrayLike, high: ArrayLike) -> Array:
    """np.clip in a fraction of its time, which for one robot is most of it."""
    return np.minimum(np.maximum(values, low), high)


def _table(path: ReferencePath, config: TrackerConfig) -> Array:
    """(M, 5) rows x, y, heading, curvature, chord of a path; an open one with its straight continuation."""
    s = np.arange(len(path.points)) * path.spacing
    if not path.closed:
        s = np.r_[s, path.length + path.spacing * np.arange(1, int(EXTENSION / path.spacing) + 1)]
    points = path.point(s)
    if config.lookahead_mode == "along":
        target = path.point(s + config.lookahead)
    else:
        window = np.arange(0.0, LOOKAHEAD_SEARCH * config.lookahead + path.spacing, path.spacing)
        target = leave_circle(path.point(s[:, None] + window), points, config.lookahead)
    heading = path.heading_at(s)
    direction = np.arctan2(target[:, 1] - points[:, 1], target[:, 0] - points[:, 0])
    chord = np.angle(np.exp(1j * (direction - heading)))
    return np.column_stack([points, heading, path.curvature_at(s), chord])
