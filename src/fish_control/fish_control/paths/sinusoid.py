# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sinusoid along x."""

from __future__ import annotations

import numpy as np

from fish_control.paths.requirements import require_positive
from fish_control.reference_path import End, ReferencePath


def sinusoid(
    amplitude: float = 0.5,
    length: float = 3.4,
    cycles: float = 1.0,
    phase: float = 0.0,
    x: float = 0.0,
    y: float = 0.0,
    end: End | None = None,
) -> ReferencePath:
    """y = amplitude sin(2 pi cycles (x - x0) / length + phase), from x - length / 2 to x + length / 2 [m,
    rad].
    """
    require_positive("sinusoid", amplitude=amplitude, length=length, cycles=cycles)
    along = np.linspace(0.0, 1.0, 16385)
    points = np.column_stack(
        [x + length * (along - 0.5), y + amplitude * np.sin(2.0 * np.pi * cycles * along + phase)]
    )
    return ReferencePath.from_points(points, name="sinusoid", end=end)
