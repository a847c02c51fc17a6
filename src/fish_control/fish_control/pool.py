"""The pool's walls, and the refusal of paths that would touch them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fish_control.reference_path import ReferencePath

HALF_LENGTH = 2.135  # m, wall at x = +-2.135 (MODEL: pool of 4.27 x 2.13 m, origin at its centre)
HALF_WIDTH = 1.065  # m, wall at y = +-1.065


class PathOutsidePoolError(ValueError):
    """A reference path comes closer to a wall than the margin allows."""


def check_inside_pool(path: ReferencePath, margin: float) -> None:
    """Refuse a path that comes closer to a wall than `margin` [m].

    Raises:
        PathOutsidePoolError: says where the path leaves, by how much, and what to change.
    """
    limits = np.array([HALF_LENGTH, HALF_WIDTH]) - margin
    excess = np.abs(path.points) - limits
    worst = np.unravel_index(np.argmax(excess), excess.shape)
    if excess[worst] <= 0.0:
        return
    x, y = path.points[worst[0]]
    axis = "xy"[worst[1]]
    raise PathOutsidePoolError(
        f"path '{path.name}' reaches ({x:.2f}, {y:.2f}) m at {worst[0] * path.spacing:.2f} m along it; "
        f"with a margin of {margin:.2f} m it must stay within |{axis}| <= {limits[worst[1]]:.3f} m: "
        "make it smaller, move its centre or lower the margin"
    )
