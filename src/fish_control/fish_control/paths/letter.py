# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Capital letters, each swum in one stroke with rounded corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.letter_strokes import STROKES, Stroke
from fish_control.paths.requirements import require_positive
from fish_control.paths.rounded import ease, round_corners
from fish_control.pool import stopping_side, stopping_turn, wall_distance
from fish_control.reference_path import End, PathError, ReferencePath

TALLEST = 1.7  # m, leaves 0.21 m to the walls of the 2.13 m pool
STOPPING_MARGIN = 0.11  # m to the walls, of the place where the fish stops
STEP = 0.01  # m, of the search for a height


def letter(
    letter: str = "R",
    height: float | None = None,
    x: float = 0.0,
    y: float = 0.0,
    easing: float = 0.05,
    end: End | None = None,
) -> ReferencePath:
    """A letter in the order of its stroke.

    Letters with several strokes are joined: the fish turns in a loop outside the letter instead of lifting a pen.

    Args:
        height: [m]; by default up to TALLEST, lower and off the centre where the fish needs room to stop at the end.
        x, y: offset from there, or with a height of the letter's middle from the pool's centre [m].
        easing: arc length over which curvature builds up [m].
    """
    key = str(letter).upper()
    if key not in STROKES:
        raise PathError(f"letter: unknown letter {letter!r}; known: {' '.join(STROKES)}")
    stroke = STROKES[key]
    shape = _unit_shape(stroke)
    rise = 0.0
    if height is None:
        height, rise = _fit(shape, stroke.closed)
    require_positive("letter", height=height)
    points = shape * height + [x, y + rise]
    if easing > 0.0:
        points = ease(points, easing, stroke.closed)
    return ReferencePath.from_points(points, name=f"letter {key}", closed=stroke.closed, end=end)


def _unit_shape(stroke: Stroke) -> NDArray[np.float64]:
    """The rounded letter, one high, about its middle."""
    corners = np.array([corner[:2] for corner in stroke.corners], dtype=float)
    radius = np.array(
        [corner[2] if len(corner) > 2 else stroke.radius for corner in stroke.corners]
    )
    points = round_corners(corners, radius, stroke.closed)
    low, high = points.min(axis=0), points.max(axis=0)
    shape: NDArray[np.float64] = (points - 0.5 * (low + high)) / (high[1] - low[1])
    return shape


def _fit(shape: NDArray[np.float64], closed: bool) -> tuple[float, float]:
    """Largest height [m] and smallest rise of the middle [m] with which the letter and its stopping turn fit."""
    edge = 0.5 * TALLEST
    heading = float(np.arctan2(*(shape[-1] - shape[-2])[::-1]))
    for height in np.arange(TALLEST, 0.5 * TALLEST, -STEP):
        room = edge - 0.5 * height
        for rise in sorted(np.arange(-room, room + STEP, STEP), key=abs):
            x, y = shape[-1] * height + [0.0, rise]
            turn = stopping_turn(x, y, heading, stopping_side(x, y, heading))
            if closed or wall_distance(turn) >= STOPPING_MARGIN:
                return float(height), float(rise)
    raise AssertionError("a letter of half the height always has room")
