# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Paths with a formula of their own: straight line, circle, figure of eight, sinusoid, square wave."""

from __future__ import annotations

import numpy as np

from fish_control.paths.rounded import round_corners
from fish_control.reference_path import End, PathError, ReferencePath, require_positive


def straight(
    length: float = 3.4, course: float = 0.0, x: float = 0.0, y: float = 0.0, end: End | None = None
) -> ReferencePath:
    """Line of `length` [m] centred on (x, y) along `course` [rad]."""
    require_positive("straight", length=length)
    half = 0.5 * length * np.array([np.cos(course), np.sin(course)])
    middle = np.array([x, y], dtype=float)
    return ReferencePath.from_points([middle - half, middle + half], name="straight", end=end)


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


def figure_eight(
    length: float = 2.8, width: float = 1.2, x: float = 0.0, y: float = 0.0, end: End | None = None
) -> ReferencePath:
    """x = length / 2 sin t, y = width / 2 sin 2t about (x, y) [m], from the crossing towards +x and +y."""
    require_positive("figure_eight", length=length, width=width)
    t = np.linspace(0.0, 2.0 * np.pi, 16385)[:-1]
    points = np.column_stack([x + 0.5 * length * np.sin(t), y + 0.5 * width * np.sin(2.0 * t)])
    return ReferencePath.from_points(points, name="figure_eight", closed=True, end=end)


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
