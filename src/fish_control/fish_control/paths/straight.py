# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Straight line."""

from __future__ import annotations

import numpy as np

from fish_control.paths.requirements import require_positive
from fish_control.reference_path import End, ReferencePath


def straight(
    length: float = 3.4, course: float = 0.0, x: float = 0.0, y: float = 0.0, end: End | None = None
) -> ReferencePath:
    """Line of `length` [m] centred on (x, y) along `course` [rad]."""
    require_positive("straight", length=length)
    half = 0.5 * length * np.array([np.cos(course), np.sin(course)])
    middle = np.array([x, y], dtype=float)
    return ReferencePath.from_points([middle - half, middle + half], name="straight", end=end)
