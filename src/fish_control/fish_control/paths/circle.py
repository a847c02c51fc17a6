# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Circle."""

from __future__ import annotations

import numpy as np

from fish_control.paths.requirements import require_positive
from fish_control.reference_path import End, PathError, ReferencePath


def circle(
    radius: float = 0.6,
    x: float = 0.0,
    y: float = 0.0,
    start: float = -0.5 * np.pi,
    direction: int = 1,
    end: End | None = None,
) -> ReferencePath:
    """Circle of `radius` [m] about (x, y) [m], from polar angle `start` [rad].

    Direction 1 is counter-clockwise, -1 clockwise.
    """
    require_positive("circle", radius=radius)
    if direction not in (1, -1):
        raise PathError(
            f"circle: direction is {direction!r}, expected 1 (counter-clockwise) or -1 (clockwise)"
        )
    angle = start + direction * np.linspace(0.0, 2.0 * np.pi, 8193)[:-1]
    points = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])
    return ReferencePath.from_points(points, name="circle", closed=True, end=end)
