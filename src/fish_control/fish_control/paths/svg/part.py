# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A visible shape with its place on the page."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.svg.clip import Clip, check_unclipped
from fish_control.paths.svg.outline import Outline, Viewport, outlines
from fish_control.paths.svg.placement import place
from fish_control.paths.svg.style import local_name
from fish_control.paths.svg.units import pixels
from fish_control.reference_path import PathError

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
