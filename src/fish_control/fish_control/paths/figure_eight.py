# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figure of eight (lemniscate of Gerono), a closed path that crosses itself."""

from __future__ import annotations

import numpy as np

from fish_control.paths.requirements import require_positive
from fish_control.reference_path import End, ReferencePath


def figure_eight(
    length: float = 2.8, width: float = 1.2, x: float = 0.0, y: float = 0.0, end: End | None = None
) -> ReferencePath:
    """x = length / 2 sin t, y = width / 2 sin 2t about (x, y) [m], from the crossing towards +x and +y."""
    require_positive("figure_eight", length=length, width=width)
    t = np.linspace(0.0, 2.0 * np.pi, 16385)[:-1]
    points = np.column_stack([x + 0.5 * length * np.sin(t), y + 0.5 * width * np.sin(2.0 * t)])
    return ReferencePath.from_points(points, name="figure_eight", closed=True, end=end)
