"""User-drawn paths: a CSV file of points or an SVG drawing."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.requirements import require_positive
from fish_control.paths.rounded import round_corners
from fish_control.paths.svg import read_svg
from fish_control.reference_path import End, PathError, ReferencePath


def polyline(
    file: str = "",
    size: float | None = None,
    radius: float = 0.2,
    closed: bool | None = None,
    x: float = 0.0,
    y: float = 0.0,
    end: End | None = None,
) -> ReferencePath:
    """Path through the points of a CSV file (columns x, y in metres) or the outline of an SVG drawing.

    Args:
        size: larger side of the drawing [m], which is then centred on (x, y). An SVG drawing has no metres
            and takes 1.4 m unless told; without a size the points of a CSV file are used where they are,
            moved by (x, y).
        radius: corners are rounded to this [m].
        closed: join the last point to the first; by default when they coincide, or when an SVG outline is
            closed.
    """
    if not file:
        raise PathError("polyline: no file given; set file to a .csv or .svg")
    path = Path(file)
    readers = {".csv": _read_csv, ".svg": read_svg}
    if path.suffix.lower() not in readers:
        raise PathError(f"polyline: {file!r} ends in {path.suffix!r}; known: {', '.join(readers)}")
    try:
        points, joined = readers[path.suffix.lower()](path)
    except OSError as error:
        raise PathError(f"polyline: cannot read {file!r}: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise PathError(f"polyline: {file!r} is not UTF-8 text with lines x,y ({error})") from error
    if len(points) < 2:
        raise PathError(f"polyline: {file!r} has {len(points)} points; 2 are needed")
    if size is None and path.suffix.lower() == ".svg":
        size = 1.4
    if size is not None:
        points = _fit(points, size)
    closed = joined if closed is None else bool(closed)
    if closed and np.allclose(points[0], points[-1]):
        points = points[:-1]
    keep = np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9]
    rounded = round_corners(points[keep] + [x, y], radius, closed)
    return ReferencePath.from_points(rounded, name=path.name, closed=closed, end=end)


def _fit(points: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Scale to `size` [m] and centre on the origin."""
    require_positive("polyline", size=size)
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float(np.max(high - low))
    if extent <= 0.0:
        raise PathError("polyline: all points are the same")
    fitted: NDArray[np.float64] = (points - 0.5 * (low + high)) * size / extent
    return fitted


def _read_csv(path: Path) -> tuple[NDArray[np.float64], bool]:
    """Points and whether the last repeats the first; a heading line is allowed."""
    points = []
    with path.open(newline="", encoding="utf-8-sig") as stream:
        for number, row in enumerate(csv.reader(stream), start=1):
            if not row or row[0].lstrip().startswith("#"):
                continue
            try:
                point = float(row[0]), float(row[1])
            except (ValueError, IndexError):
                if number == 1:
                    continue
                raise PathError(
                    f"{path}: line {number} is {','.join(row)!r}, expected two numbers x,y"
                ) from None
            if not all(map(math.isfinite, point)):
                raise PathError(f"{path}: line {number} has a coordinate that is not finite")
            points.append(point)
    array = np.array(points, dtype=float).reshape(-1, 2)
    return array, len(array) > 3 and bool(np.allclose(array[0], array[-1]))
