# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The points of shapes: paths, lines, polygons, rectangles and ellipses."""

from __future__ import annotations

import re
from collections.abc import Callable
from xml.etree.ElementTree import Element

import numpy as np
import svgelements
from numpy.typing import NDArray

from fish_control.paths.svg.commands import absolute_commands
from fish_control.paths.svg.style import local_name
from fish_control.paths.svg.units import JOINT, NUMBER, finite, pixels
from fish_control.reference_path import PathError

Array = NDArray[np.float64]
Outline = tuple[Array, bool]  # points (M, 2) in the shape's own units, and whether they are closed
Viewport = tuple[float, float]  # width and height that percentages refer to [px]

# of the curve's size, between a curve and its chords: an angle of 0.5 degrees on a circle
FLATNESS = 2e-6


def outlines(element: Element, viewport: Viewport, where: str) -> list[Outline]:
    """The parts of a shape, each drawn without lifting the pen; those of no length are left out.

    Raises:
        PathError: an outline that is not as SVG defines it.

    """
    path = _SHAPES[local_name(element)](element, viewport, where)
    parts: list[tuple[list[Array], bool]] = []
    restart = False
    for segment in path:
        if isinstance(segment, svgelements.Move):
            parts.append(([np.array(segment.end, dtype=float)[None]], False))
        elif isinstance(segment, svgelements.Close):
            parts[-1] = (parts[-1][0], True)
        else:
            if restart:  # after Z a new part begins where the last one began
                parts.append(([parts[-1][0][0]], False))
            parts[-1][0].append(_flatten(segment))
        restart = isinstance(segment, svgelements.Close)
    drawn = [(np.vstack(points), closed) for points, closed in parts]
    return [(points, closed) for points, closed in drawn if np.ptp(points, axis=0).any()]


def _flatten(segment: svgelements.PathSegment) -> Array:
    """Points on a segment without its first one, closer where it bends more."""
    end = np.array(segment.end, dtype=float)[None]
    straight = isinstance(segment, svgelements.Line)
    if straight or (isinstance(segment, svgelements.Arc) and not segment.rx * segment.ry):
        return end
    coarse = np.asarray(segment.npoint(np.linspace(0.0, 1.0, 33)), dtype=float)
    bend = np.linalg.norm(np.diff(coarse, 2, axis=0), axis=1).max() * 32.0**2  # second derivative
    size = np.ptp(coarse, axis=0).max()
    if not size:
        return end
    count = int(np.clip(np.sqrt(bend / (8.0 * FLATNESS * size)), 8, 1024))
    points: Array = np.asarray(segment.npoint(np.linspace(0.0, 1.0, count + 1)), dtype=float)[1:]
    points[-1] = end
    return points


def _path(element: Element, _: Viewport, where: str) -> svgelements.Path:
    return svgelements.Path(absolute_commands(element.get("d", ""), where))


def _vertices(element: Element, _: Viewport, where: str) -> svgelements.Path:
    numbers = re.split(rf"\s*,\s*|\s+|{JOINT}", element.get("points", "").strip())
    numbers = [] if numbers == [""] else numbers
    strange = [n for n in numbers if not re.fullmatch(NUMBER, n)]
    if strange or len(numbers) % 2:
        came = f"{strange[0]!r} among them" if strange else f"{len(numbers)} numbers"
        raise PathError(f"{where}: points have {came}, expected pairs of numbers x,y without units")
    points = np.array([finite(n, where) for n in numbers]).reshape(-1, 2)
    closed = local_name(element) == "polygon"
    if len(points) < 2:
        raise PathError(f"{where}: {len(points)} points; 2 are needed")
    commands = " L ".join(f"{x!r},{y!r}" for x, y in points.tolist())
    return svgelements.Path(f"M {commands}{' Z' if closed else ''}")


def _line(element: Element, viewport: Viewport, where: str) -> svgelements.Path:
    x1, x2 = (_length(element, key, viewport[0], where) for key in ("x1", "x2"))
    y1, y2 = (_length(element, key, viewport[1], where) for key in ("y1", "y2"))
    return svgelements.Path(f"M {x1!r},{y1!r} L {x2!r},{y2!r}")


def _rect(element: Element, viewport: Viewport, where: str) -> svgelements.Path:
    x, width = (_length(element, key, viewport[0], where) for key in ("x", "width"))
    y, height = (_length(element, key, viewport[1], where) for key in ("y", "height"))
    given = {
        key: _length(element, key, viewport[side], where)
        for side, key in enumerate(("rx", "ry"))
        if element.get(key, "auto").strip() != "auto"
    }
    if not (width > 0.0 and height > 0.0):
        return svgelements.Path()
    rx = min(given.get("rx", given.get("ry", 0.0)), width / 2.0)
    ry = min(given.get("ry", given.get("rx", 0.0)), height / 2.0)
    return svgelements.Path(svgelements.Rect(x, y, width, height, rx, ry))


def _ellipse(element: Element, viewport: Viewport, where: str) -> svgelements.Path:
    cx, cy = (_length(element, key, viewport[i], where) for i, key in enumerate(("cx", "cy")))
    if local_name(element) == "circle":
        diagonal = float(np.hypot(*viewport) / np.sqrt(2.0))  # SVG 2, section 8.9
        rx = ry = _length(element, "r", diagonal, where)
    else:
        rx, ry = (_length(element, key, viewport[i], where) for i, key in enumerate(("rx", "ry")))
    if not (rx > 0.0 and ry > 0.0):
        return svgelements.Path()
    return svgelements.Path(svgelements.Ellipse(cx=cx, cy=cy, rx=rx, ry=ry))


def _length(element: Element, key: str, whole: float, where: str) -> float:
    return pixels(element.get(key, "").strip() or "0", f"{where}: {key}", whole)


_SHAPES: dict[str, Callable[[Element, Viewport, str], svgelements.Path]] = {
    "path": _path,
    "polyline": _vertices,
    "polygon": _vertices,
    "line": _line,
    "rect": _rect,
    "circle": _ellipse,
    "ellipse": _ellipse,
}
SHAPES = tuple(_SHAPES)
