# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Clip paths: an outline that lies inside is shown whole, any other is refused."""

from __future__ import annotations

import re
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.svg.outline import SHAPES, Viewport, outlines
from fish_control.paths.svg.placement import place, transform
from fish_control.paths.svg.style import local_name
from fish_control.reference_path import PathError

Array = NDArray[np.float64]

STEPS = 500  # places along a line as long as the clip that are looked at


@dataclass(frozen=True)
class Clip:
    """Polygons on the page [px], outside of which nothing is shown."""

    polygons: tuple[Array, ...]
    name: str


def read_clip(
    reference: str, by_id: dict[str, Element], matrix: Array, viewport: Viewport, where: str
) -> Clip:
    """The clip path that `url(#id)` names, for an element whose units `matrix` takes to the page.

    Raises:
        PathError: a clip path other than shapes in the element's own units.

    """
    match = re.fullmatch(r"url\(\s*['\"]?#(.+?)['\"]?\s*\)", reference)
    element = by_id.get(match[1]) if match else None
    simple = element is not None and local_name(element) == "clipPath"
    if (
        element is None
        or not simple
        or element.get("clipPathUnits", "userSpaceOnUse") != "userSpaceOnUse"
    ):
        raise PathError(
            f"{where} has the clip path {reference!r}, which is not supported; release the clip"
        )
    shapes = [child for child in element if local_name(child) not in ("title", "desc")]
    if any(local_name(s) not in SHAPES or s.get("clip-path") or s.get("style") for s in shapes):
        raise PathError(
            f"{where} has the clip path {reference!r} of more than plain shapes; release the clip"
        )
    matrix = matrix @ transform(element.get("transform", ""), where)
    polygons = tuple(
        place(matrix @ transform(shape.get("transform", ""), where), points)
        for shape in shapes
        for points, _ in outlines(shape, viewport, where)
    )
    return Clip(polygons, f"the clip path {reference}")


def check_unclipped(points: Array, clips: tuple[Clip, ...], where: str) -> None:
    """Refuse an outline of which a clip hides a part.

    Raises:
        PathError: a place of it lies outside every polygon of a clip.

    """
    for clip in clips:
        close = _closer(points, max(float(np.ptp(p, axis=0).max()) for p in clip.polygons) / STEPS)
        if not any(_inside(polygon, close).all() for polygon in clip.polygons):
            raise PathError(
                f"{where} is cut off by {clip.name}; draw only what is to be swum, or release the clip"
            )


def _closer(points: Array, step: float) -> Array:
    """The points with others between them, so that none are farther apart than `step`."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    counts = np.clip(np.ceil(lengths / max(step, 1e-300)), 1, STEPS).astype(int)
    pieces = [
        start + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (end - start)
        for start, end, count in zip(points[:-1], points[1:], counts, strict=True)
    ]
    return np.vstack([*pieces, points[-1:]])


def _inside(polygon: Array, points: Array) -> NDArray[np.bool_]:
    """Whether each point is inside or on a polygon: a ray to the right crosses it an odd number of times."""
    margin = 1e-6 * float(np.ptp(polygon, axis=0).max() or 1.0)
    ends = np.roll(polygon, -1, axis=0)
    inside = np.zeros(len(points), dtype=bool)
    for (x0, y0), (x1, y1) in zip(polygon, ends, strict=True):
        between = (y0 > points[:, 1]) != (y1 > points[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            at = x0 + (points[:, 1] - y0) * (x1 - x0) / (y1 - y0)
        inside ^= between & (points[:, 0] < at)
    step = ends - polygon
    length = np.maximum((step**2).sum(axis=1), 1e-300)
    for corner, along, squared in zip(polygon, step, length, strict=True):
        share = np.clip((points - corner) @ along / squared, 0.0, 1.0)
        inside |= np.hypot(*(points - corner - share[:, None] * along).T) <= margin
    return inside
