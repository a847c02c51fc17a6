# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The line of an SVG drawing, as a viewer shows it and at its true size.

The library svgelements reads the outline's commands, transforms, viewBox and colours; what is drawn at all is decided
here, because a fish must not swim what nobody sees.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fish_control.paths.svg.coordinates import METRES_PER_PIXEL
from fish_control.paths.svg.document import read_parts
from fish_control.paths.svg.part import Part
from fish_control.reference_path import PathError


@dataclass(frozen=True)
class Drawing:
    """One line of an SVG file.

    Attributes:
        points: (M, 2), x to the right and y up. In metres, or in drawing units where the file states no size.
        closed: the line ends where it begins.
        has_size: the file states its size, so that the points are metres.

    """

    points: NDArray[np.float64]
    closed: bool
    has_size: bool


def read_svg(file: Path, chosen: str | None = None) -> Drawing:
    """The one visible line of a drawing, or that of the element or group with the id `chosen`.

    SVG's y axis points down, the pool's y axis up on the page: y changes its sign here and nowhere else.

    Raises:
        PathError: no SVG drawing, nothing or several lines to swim, or something whose look this reader cannot judge.

    """
    parts, has_size = read_parts(file)
    part = _choose(parts, file, chosen)
    outlines = part.outlines()
    if len(outlines) > 1:
        raise PathError(
            f"{file}: {part.name} has {len(outlines)} parts; a fish cannot lift off: draw it in one stroke, or break it"
            " apart (Inkscape: Path > Break Apart) and choose a part by `id:`"
        )
    points, closed = outlines[0] if outlines else (np.zeros((0, 2)), False)
    if not np.isfinite(points).all():
        raise PathError(
            f"{file}: {part.name} has coordinates that are too large; scale the drawing"
        )
    scale = METRES_PER_PIXEL if has_size else 1.0
    return Drawing(points * [scale, -scale], closed, has_size)


def _choose(parts: list[Part], file: Path, chosen: str | None) -> Part:
    """The only visible part; with an id the only visible part of that element."""
    among = parts if chosen is None else [part for part in parts if chosen in part.ids]
    names = ", ".join(part.name for part in (among or parts)[:12])
    if not parts:
        raise PathError(
            f"{file}: no visible line in the drawing (hidden layers, definitions, transparent lines and those off the page do"
            " not count)"
        )
    if not among:
        raise PathError(f"{file}: no visible part with id {chosen!r}; visible: {names}")
    if len(among) > 1:
        raise PathError(
            f"{file}: {len(among)} visible parts ({names}); a fish cannot lift off: hide the others, or choose one by"
            " `id:`"
        )
    return among[0]


__all__ = ["Drawing", "read_svg"]
