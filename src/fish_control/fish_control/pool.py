# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's walls, and the refusal of paths that would touch them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_control.reference_path import ReferencePath
from fish_node.pool import LENGTH, WIDTH

HALF_LENGTH = LENGTH / 2.0  # m, walls at x = +-HALF_LENGTH
HALF_WIDTH = WIDTH / 2.0  # m, walls at y = +-HALF_WIDTH
# m, of the turn in which a fish stops with its rudder hard over; it turns in 0.257 m
STOPPING_RADIUS = 0.27
STOPPING_TURN = 1.9  # rad, how far it comes round from 0.3 m/s (1.5 rad from 0.2 m/s)


class PathOutsidePoolError(ValueError):
    """A reference path comes closer to a wall than the margin allows."""


def check_inside_pool(path: ReferencePath, margin: float) -> None:
    """Refuse a path that comes closer to a wall than `margin` [m], itself or while the fish stops at its end.

    Raises:
        PathOutsidePoolError: says where the path leaves, by how much, and what to change.
    """
    _check(path.points, "reaches", path, margin)
    if path.end == "stop":
        end, heading = path.point(path.length), float(path.heading_at(path.length))
        turn = stopping_turn(end[0], end[1], heading, stopping_side(end[0], end[1], heading))
        _check(turn, "ends so that the stopping fish comes to", path, margin)


def stopping_turn(x: float, y: float, heading: float, side: float) -> NDArray[np.float64]:
    """Points (N, 2) [m] of the turn to a side (+1 left, -1 right) in which a fish stops."""
    angle = heading + side * np.linspace(0.0, STOPPING_TURN, 32)
    arc = np.column_stack([np.sin(angle) - np.sin(heading), np.cos(heading) - np.cos(angle)])
    points: NDArray[np.float64] = [x, y] + side * STOPPING_RADIUS * arc
    return points


def stopping_side(x: float, y: float, heading: float) -> float:
    """The side (+1 left, -1 right) to which the fish stops farther from the walls."""
    return max((1.0, -1.0), key=lambda side: wall_distance(stopping_turn(x, y, heading, side)))


def wall_distance(points: NDArray[np.float64]) -> float:
    """Smallest distance [m] of points (N, 2) to a wall; negative outside."""
    return float(np.min([HALF_LENGTH, HALF_WIDTH] - np.abs(points)))


def _check(points: NDArray[np.float64], does: str, path: ReferencePath, margin: float) -> None:
    limits = np.array([HALF_LENGTH, HALF_WIDTH]) - margin
    excess = np.abs(points) - limits
    index, axis = np.unravel_index(np.argmax(excess), excess.shape)
    if excess[index, axis] > 0.0:
        x, y = points[index]
        raise PathOutsidePoolError(
            f"path '{path.name}' {does} ({x:.2f}, {y:.2f}) m; with a margin of {margin:.2f} m to the walls this must "
            f"stay within |{'xy'[axis]}| <= {limits[axis]:.3f} m: make it smaller, move its centre or lower the margin"
        )
