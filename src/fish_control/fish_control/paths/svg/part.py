# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A visible shape with its place on the page, and the clip paths around it.

An outline that lies inside its clip path is shown whole, any other is refused.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.svg.coordinates import pixels, place, transform
from fish_control.paths.svg.outline import SHAPES, Outline, Viewport, outlines
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


NO_LINE = ("text", "image", "foreignObject")  # seen, but without a line that could be swum


@dataclass(frozen=True)
class Part:
    """A visible element with everything that its place and its outline depend on."""

    element: Element
    ids: tuple[str, ...]  # its own id and those of the groups around it
    name: str
    matrix: NDArray[np.float64]  # (3, 3) from its own units to the page [px]
    viewport: Viewport
    clips: tuple[Clip, ...]
    where: str

    def outlines(self) -> list[Outline]:
        """Points (M, 2) on the page [px, y down] of everything that is drawn without lifting the pen.

        Raises:
            PathError: an element without an outline, or an outline that is clipped.

        """
        tag = local_name(self.element)
        if tag in NO_LINE:
            raise PathError(
                f"{self.where}: {tag} has no line to swim; turn it into a path (Inkscape: Path > Object to Path)"
            )
        drawn = self.drawn()
        for points, _ in drawn:
            check_unclipped(points, self.clips, self.where)
        return drawn

    def drawn(self) -> list[Outline]:
        """The same without looking at clips."""
        found = outlines(self.element, self.viewport, self.where)
        return [(place(self.matrix, points), closed) for points, closed in found]

    def is_outside(self, page: Viewport) -> bool:
        """Whether all of it is outside a page of (width, height) [px]. Nothing is outside a page without a size."""
        if min(page) <= 0.0 or local_name(self.element) in NO_LINE:
            return False
        ends = np.array([(p.min(axis=0), p.max(axis=0)) for p, _ in self.drawn()])  # (N, 2, 2)
        return bool(((ends[:, 1] < 0.0) | (ends[:, 0] > page)).any(axis=1).all())

    def lengths(self) -> list[float]:
        """Lengths of the outlines in the units of its dashes; none for an element without an outline."""
        if local_name(self.element) in NO_LINE:
            return []
        if stated := self.element.get("pathLength"):
            return [pixels(stated, f"{self.where}: pathLength")]
        found = outlines(self.element, self.viewport, self.where)
        return [float(np.hypot(*np.diff(points, axis=0).T).sum()) for points, _ in found]
