# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""User-drawn paths: a CSV file of points or an SVG drawing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.points_file import read_points
from fish_control.paths.rounded import round_corners
from fish_control.paths.svg import read_svg
from fish_control.reference_path import End, PathError, ReferencePath, require_positive
from fish_node.file_head import packed_as

SUFFIXES = (".csv", ".svg")


def polyline(
    file: str = "",
    id: str | None = None,
    scale: float | None = None,
    width: float | None = None,
    size: float | None = None,
    radius: float = 0.2,
    closed: bool | None = None,
    x: float = 0.0,
    y: float = 0.0,
    end: End | None = None,
) -> ReferencePath:
    """Path through the points of a CSV file (columns x, y) or along the one visible line of an SVG drawing.

    A drawing has its true size: a line of 300 mm on the page is 0.3 m long. Its middle is put at (x, y). The page's
    right is the pool's x axis, the page's top its y axis. Points of a CSV file stay where they are, moved by (x, y).

    Args:
        id: the element or group of the SVG drawing to swim; needed where several parts are visible.
        scale: factor for all lengths, for points of a CSV file about the pool's centre.
        width: how wide the path becomes along x [m]; it is then centred on (x, y).
        size: the same for its larger side; only one of `scale`, `width` and `size` may be given.
        radius: corners are rounded to this [m].
        closed: join the last point to the first; by default when they coincide, or when an SVG outline is closed.

    """
    path = Path(str(file))
    if not file:
        raise PathError("polyline: no file given; set file to a .csv or .svg")
    if path.suffix.lower() not in SUFFIXES:
        raise PathError(f"polyline: {file!r} ends in {path.suffix!r}; known: {', '.join(SUFFIXES)}")
    given = {k: v for k, v in (("scale", scale), ("width", width), ("size", size)) if v is not None}
    if len(given) > 1:
        raise PathError(f"polyline: {' and '.join(given)} are given, expected one of them")
    require_positive("polyline", **given)
    if not 0.0 <= radius < np.inf:
        raise PathError(f"polyline: radius is {radius!r}, expected a number from 0")
    points, joined, fixed = _read(path, None if id is None else str(id), bool(given))
    if len(points) < 2:
        raise PathError(f"polyline: {file!r} has {len(points)} points; 2 are needed")
    points = _scaled(points, fixed, given)
    coincide = len(points) > 3 and bool(np.allclose(points[0], points[-1]))
    closed = joined or coincide if closed is None else bool(closed)
    if closed and np.allclose(points[0], points[-1]):
        points = points[:-1]
    keep = np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9]
    rounded = round_corners(points[keep] + [x, y], radius, closed)
    return ReferencePath.from_points(rounded, name=path.name, closed=closed, end=end)


def _read(path: Path, chosen: str | None, scaled: bool) -> tuple[NDArray[np.float64], bool, bool]:
    """Points [m], whether an outline is closed, and whether the points have their place in the pool."""
    try:
        with path.open("rb") as opened:
            said = packed_as(opened.read(32))
        if said:
            raise PathError(f"polyline: {str(path)!r} is {said}")
        if path.suffix.lower() == ".csv":
            if chosen is not None:
                raise PathError(
                    f"polyline: id is {chosen!r}, but a .csv file has no parts with ids"
                )
            return read_points(path), False, True
        drawing = read_svg(path, chosen)
    except OSError as error:
        raise PathError(f"polyline: cannot read {str(path)!r}: {error.strerror}") from error
    if not drawing.has_size and not scaled:
        raise PathError(
            f"polyline: {str(path)!r} states no size (an <svg> with viewBox and without width and height); say how wide"
            " the path is, for example width: 1.4 [m]"
        )
    return drawing.points, drawing.closed, False


def _scaled(
    points: NDArray[np.float64], fixed: bool, given: dict[str, float]
) -> NDArray[np.float64]:
    """Points of the wanted size; about the origin where they have no place of their own, or a size is given."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = np.zeros(2) if fixed and not {"width", "size"} & set(given) else 0.5 * (low + high)
    factor = given.get("scale", 1.0)
    if "scale" not in given and given:
        extent = float((high - low)[0] if "width" in given else np.max(high - low))
        if extent <= 0.0:
            raise PathError(
                "polyline: all points are the same, or one above the other, so that they have no width"
            )
        factor = next(iter(given.values())) / extent
    scaled: NDArray[np.float64] = (points - middle) * factor
    return scaled
