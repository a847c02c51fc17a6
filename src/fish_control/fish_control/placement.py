# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where a fish that swims without looking must begin to stay in the pool."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fish_control.pool import HALF_LENGTH, HALF_WIDTH

Array = NDArray[np.float64]

HEADINGS = 60  # tried for a start


def find_start(way: Array, random: np.random.Generator, margin: float) -> Array | None:
    """A pose (3,) from which a way (T, 3), swum from the origin, keeps `margin` [m] from all walls; None if none was found."""
    half = np.array([HALF_LENGTH - margin, HALF_WIDTH - margin])
    for heading in random.uniform(-np.pi, np.pi, HEADINGS):
        cos, sin = np.cos(heading), np.sin(heading)
        x, y = way[:, 0] * cos - way[:, 1] * sin, way[:, 0] * sin + way[:, 1] * cos
        low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
        if np.all(high - low < 2.0 * half):
            place = random.uniform(-half - low, half - high)
            return np.array([*place, heading])
    return None
