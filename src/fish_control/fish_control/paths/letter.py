# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Capital letters, each swum in one stroke with rounded corners.

A stroke is a row of corners to be rounded, in units of letter height: (x, y) or (x, y, radius). Turns that a pen would make by
lifting are loops, because a fish can neither stop nor turn on the spot. No radius is below 0.165 heights (0.28 m for a letter of
1.7 m), or 0.18 where the letter must be lower: the nominal fish turns in 0.26 m with its rudder hard over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.rounded import ease, round_corners
from fish_control.pool import stopping_side, stopping_turn, wall_distance
from fish_control.reference_path import End, PathError, ReferencePath, require_positive
from fish_node.pool import LENGTH, WIDTH

TIGHTEST = 0.165  # letter heights


@dataclass(frozen=True)
class Stroke:
    """Corners of one letter in the order swum; `radius` rounds corners that give none."""

    corners: tuple[tuple[float, ...], ...]
    radius: float = TIGHTEST
    closed: bool = False


STROKES: dict[str, Stroke] = {
    "A": Stroke(((0, 0), (0.42, 1), (0.84, 0), (1.2, 0), (1.2, 0.4), (0.05, 0.4))),
    "B": Stroke(
        (
            (0, 0),
            (0, 1),
            (0.6, 1),
            (0.6, 0.666),
            (0.2, 0.666),
            (0.2, 0.334),
            (0.7, 0.334),
            (0.7, 0),
            (0, 0),
        )
    ),
    "C": Stroke(((0.65, 1), (0, 1), (0, 0), (0.65, 0)), 0.33),
    "D": Stroke(((0, 0), (0, 1, 0.2), (0.7, 1), (0.7, 0), (0.05, 0)), 0.35),
    "E": Stroke(
        ((0.65, 1), (0, 1), (0, 0.666), (0.45, 0.666), (0.45, 0.334), (0, 0.334), (0, 0), (0.65, 0))
    ),
    "F": Stroke(((0.65, 1), (0, 1), (0, 0), (-0.34, 0), (-0.34, 0.5), (0.5, 0.5))),
    "G": Stroke(((0.65, 1), (0, 1), (0, 0), (0.65, 0), (0.65, 0.5), (0.3, 0.5)), 0.25),
    "H": Stroke(
        ((0, 1), (0, 0), (-0.36, 0), (-0.36, 0.5), (1.01, 0.5), (1.01, 1), (0.65, 1), (0.65, 0)),
        0.18,
    ),
    "I": Stroke(((0, 0), (0, 1))),
    "J": Stroke(((0.5, 1), (0.5, 0), (0, 0), (0, 0.35)), 0.25),
    "K": Stroke(((0, 0), (0, 1), (0.62, 1), (0.05, 0.5), (0.65, 0)), 0.18),
    "L": Stroke(((0, 1), (0, 0), (0.65, 0)), 0.2),
    "M": Stroke(((0, 0), (0.25, 1), (0.75, 0.1), (1.25, 1), (1.5, 0))),
    "N": Stroke(((0, 0), (0, 1), (0.9, 0), (0.9, 1)), 0.18),
    "O": Stroke(((0, 0.62), (0, 0), (0.72, 0), (0.72, 1), (0, 1)), 0.36, closed=True),
    "P": Stroke(((0, 0), (0, 1, 0.2), (0.6, 1), (0.6, 0.48), (0.05, 0.48)), 0.26),
    "Q": Stroke(
        (
            (0.75, 0.35),
            (0.75, 1),
            (0, 1),
            (0, 0),
            (0.75, 0),
            (0.75, 0.62, 0.185),
            (0.38, 0.62, 0.185),
            (0.38, 0.3),
            (0.95, -0.1),
        ),
        0.25,
    ),
    "R": Stroke(((0, 0), (0, 1), (0.66, 1), (0.66, 0.57), (-0.251, 0.57), (0.428, 0)), 0.215),
    "S": Stroke(((0.62, 1), (0, 1), (0, 0.5), (0.62, 0.5), (0.62, 0), (0, 0)), 0.25),
    "T": Stroke(((0, 0.63), (0.81, 0.63), (0.81, 1), (0.45, 1), (0.45, 0)), 0.18),
    "U": Stroke(((0, 1), (0, 0), (0.65, 0), (0.65, 1)), 0.32),
    "V": Stroke(((0, 1), (0.45, 0), (0.9, 1))),
    "W": Stroke(((0, 1), (0.25, 0), (0.75, 0.9), (1.25, 0), (1.5, 1))),
    "X": Stroke(((0, 1), (0.7, 0), (1.1, 0), (1.1, 1), (0.7, 1), (0, 0)), 0.185),
    "Y": Stroke(((0, 0.95), (0.38, 0.4), (0.94, 0.62), (0.94, 1), (0.58, 1), (0.1, 0)), 0.18),
    "Z": Stroke(((0, 1), (0.75, 1), (0, 0), (0.75, 0))),
}


TALLEST = min(1.7, round(WIDTH - 0.43, 3))  # m, leaves 0.21 m to the long walls
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
    raise PathError(
        f"letter: no room to stop behind one in a pool of {LENGTH:g} m x {WIDTH:g} m; expected a height in m or another path"
    )
