# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sheet of coded tags to print in true millimetres, as SVG: every tag with its white rim and number, and a ruler."""

from collections.abc import Sequence
from xml.sax.saxutils import escape

import numpy as np

from fish_vision.tags import tag_picture, tags_in

PAGES = {"A4": (210.0, 297.0), "A3": (297.0, 420.0), "letter": (215.9, 279.4)}  # mm
MARGIN = 12.0  # mm, which printers leave white
TEXT = 4.0  # mm, height of a line of text
RULER = 100.0  # mm
SIDE_LEAST, SIDE_MOST = 5.0, 180.0  # mm


def tag_sheet(
    dictionary: str, numbers: Sequence[int], side: float, page: tuple[float, float]
) -> str:
    """SVG of one page.

    Args:
        dictionary: OpenCV's name without DICT_, such as 4X4_50.
        numbers: of the tags, in the order of the page.
        side: of a tag's black square, mm.
        page: width and height, mm.

    Raises:
        ValueError: an unknown dictionary or number, a side out of range, or tags that do not fit on the page.
    """
    known = tags_in(dictionary)
    if wrong := [number for number in numbers if not 0 <= number < known]:
        raise ValueError(f"tag {wrong[0]}: {dictionary} has the numbers 0 to {known - 1}")
    if not SIDE_LEAST <= side <= SIDE_MOST:
        raise ValueError(f"side {side:g} mm: expected {SIDE_LEAST:g} to {SIDE_MOST:g}")
    cells = tag_picture(dictionary, 0).shape[0]
    cell = side / cells
    width, height = side + 2.0 * cell, side + 2.0 * cell + 1.5 * TEXT
    columns = int((page[0] - 2.0 * MARGIN) // width)
    rows = int((page[1] - 2.0 * MARGIN - 3.0 * TEXT) // height)
    if len(numbers) > columns * rows:
        raise ValueError(
            f"{len(numbers)} tags of {side:g} mm: {columns * rows} fit on a page of {page[0]:g} x {page[1]:g} mm; make more "
            "sheets or smaller tags"
        )
    parts = [_ruler(page)]
    for k, number in enumerate(numbers):
        left, top = MARGIN + k % columns * width, MARGIN + k // columns * height
        parts.append(_tag(dictionary, number, (left, top), cell))
        parts.append(_text(left + cell, top + side + 2.0 * cell + TEXT, f"{dictionary} {number}"))
    size = f'width="{page[0]:g}mm" height="{page[1]:g}mm" viewBox="0 0 {page[0]:g} {page[1]:g}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n' + "\n".join(parts) + "\n</svg>\n"


def _tag(dictionary: str, number: int, place: tuple[float, float], cell: float) -> str:
    """The dark cells of a tag as one path, which leaves no seams, and a thin line around its rim to cut along."""
    dark = np.argwhere(tag_picture(dictionary, number) == 0)
    corner = [coordinate + cell for coordinate in place]
    squares = "".join(
        f"M{corner[0] + x * cell:.4f} {corner[1] + y * cell:.4f}h{cell:.4f}v{cell:.4f}h{-cell:.4f}z"
        for y, x in dark
    )
    whole = (tag_picture(dictionary, number).shape[0] + 2) * cell
    rim = f'x="{place[0]:.4f}" y="{place[1]:.4f}" width="{whole:.4f}" height="{whole:.4f}"'
    return f'<path d="{squares}" fill="black"/>\n<rect {rim} fill="none" stroke="#bbb" stroke-width="0.1"/>'


def _ruler(page: tuple[float, float]) -> str:
    bottom = page[1] - MARGIN
    line = f"M{MARGIN} {bottom}h{RULER}M{MARGIN} {bottom - 2}v4M{MARGIN + RULER} {bottom - 2}v4"
    said = f"{RULER:g} mm; print at 100 %, not fitted to the page, and measure"
    return f'<path d="{line}" fill="none" stroke="black" stroke-width="0.2"/>\n' + _text(
        MARGIN, bottom - TEXT, said
    )


def _text(x: float, y: float, words: str) -> str:
    return f'<text x="{x:.4f}" y="{y:.4f}" font-family="sans-serif" font-size="3">{escape(words)}</text>'
