# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Square wave with rounded corners."""

from __future__ import annotations

import numpy as np

from fish_control.paths.requirements import require_positive
from fish_control.paths.rounded import round_corners
from fish_control.reference_path import End, PathError, ReferencePath


def square_wave(
    amplitude: float = 0.4,
    length: float = 3.2,
    cycles: int = 2,
    radius: float = 0.25,
    x: float = 0.0,
    y: float = 0.0,
    end: End | None = None,
) -> ReferencePath:
    """Square wave of +-amplitude over `length` [m], centred on (x, y), corners of `radius` [m]."""
    require_positive(
        "square_wave", amplitude=amplitude, length=length, cycles=cycles, radius=radius
    )
    if cycles != int(cycles):
        raise PathError(f"square_wave: cycles is {cycles!r}, expected a whole number")
    half_periods = 2 * int(cycles)
    edges = np.linspace(-0.5 * length, 0.5 * length, half_periods + 1)
    levels = amplitude * (-1.0) ** np.arange(half_periods)
    vertices = np.column_stack([np.repeat(edges, 2)[1:-1], np.repeat(levels, 2)]) + [x, y]
    return ReferencePath.from_points(round_corners(vertices, radius), name="square_wave", end=end)
