"""Capital letters, each swum in one stroke with rounded corners."""

from __future__ import annotations

import numpy as np

from fish_control.paths.letter_strokes import STROKES
from fish_control.paths.requirements import require_positive
from fish_control.paths.rounded import ease, round_corners
from fish_control.reference_path import End, PathError, ReferencePath

HEIGHT = 1.7  # m, leaves 0.21 m to the walls of the 2.13 m pool


def letter(
    letter: str = "R",
    height: float = HEIGHT,
    x: float = 0.0,
    y: float = 0.0,
    easing: float = 0.05,
    end: End | None = None,
) -> ReferencePath:
    """A letter of `height` [m] centred on (x, y), in the order of its stroke.

    Letters with several strokes are joined: the fish turns in a loop outside the letter instead of lifting a
    pen. `easing` [m] is the arc length over which curvature builds up.
    """
    key = str(letter).upper()
    if key not in STROKES:
        raise PathError(f"letter: unknown letter {letter!r}; known: {' '.join(STROKES)}")
    require_positive("letter", height=height)
    stroke = STROKES[key]
    corners = np.array([corner[:2] for corner in stroke.corners], dtype=float)
    radius = np.array([corner[2] if len(corner) > 2 else stroke.radius for corner in stroke.corners])
    points = round_corners(corners, radius, stroke.closed)
    low, high = points.min(axis=0), points.max(axis=0)
    points = (points - 0.5 * (low + high)) * height / (high[1] - low[1]) + [x, y]
    if easing > 0.0:
        points = ease(points, easing, stroke.closed)
    return ReferencePath.from_points(points, name=f"letter {key}", closed=stroke.closed, end=end)
