# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Square coded markers (ArUco, AprilTag), found in a picture by OpenCV, and a sheet of them to print.

This is the one place that knows OpenCV's two interfaces. The sheet is SVG in true millimetres: every tag with its white rim
and number, and a ruler.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

import cv2
import numpy as np
from numpy.typing import NDArray

from fish_vision.segmentation import Image

Array = NDArray[Any]  # float64

# None in pip's OpenCV before 4.7 without contrib; its annotations know one of the two interfaces
aruco: Any = getattr(cv2, "aruco", None)
FINDS_TAGS = aruco is not None
PREFIX = "DICT_"
OLD = not hasattr(aruco, "ArucoDetector")  # OpenCV before 4.7: functions instead of a class
SIDE_LEAST = 0.6  # share of the expected side below which a square is no tag
CELL = 6  # pixels of a cell of the template that a tag in the picture is compared with
PIXEL_BLUR = 0.6  # standard deviation of what lens and pixel soften, pixels of the picture
STEPS = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-5)
ALIKE = 0.7  # correlation of tag and template below which the corners stay as they were found

PAGES = {"A4": (210.0, 297.0), "A3": (297.0, 420.0), "letter": (215.9, 279.4)}  # mm
MARGIN = 12.0  # mm, which printers leave white
TEXT = 4.0  # mm, height of a line of text
RULER = 100.0  # mm
PRINTED_LEAST, PRINTED_MOST = 5.0, 180.0  # mm


@dataclass(frozen=True)
class Tag:
    """A tag in a picture: its number and corners (4, 2), pixels, clockwise from the upper left of the tag."""

    number: int
    corners: Array


def tags_in(dictionary: str) -> int:
    """How many tags a dictionary has, such as `4X4_50` or `APRILTAG_36h11`.

    Raises:
        ValueError: no dictionary of OpenCV has this name.
    """
    return len(_dictionary(dictionary).bytesList)


def tag_picture(dictionary: str, number: int, cell: int = 1) -> Image:
    """Tag to print, (side, side) grey, `cell` pixels for each of its cells; needs a white rim of one cell."""
    table = _dictionary(dictionary)
    side = (table.markerSize + 2) * cell
    draw = aruco.drawMarker if OLD else aruco.generateImageMarker
    picture: Image = draw(table, number, side)
    return picture


class TagDetector:
    """Finds the tags of one dictionary."""

    def __init__(self, dictionary: str) -> None:
        self._name, self._table = dictionary, _dictionary(dictionary)
        self._templates: dict[int, Image] = {}

    def find(self, image: Image, side: float) -> list[Tag]:
        """All tags whose sides are at least about as long as `side`, pixels.

        Args:
            image: (h, w, 3) blue, green, red, or (h, w) grey.
            side: shortest expected side of a tag, pixels.
        """
        if min(image.shape[:2]) < 8:
            return []
        grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        corners, numbers = self._detect(np.ascontiguousarray(grey), side)
        if numbers is None:
            return []
        return [
            Tag(int(number), self._refined(grey, int(number), np.reshape(places, (4, 2))))
            for number, places in zip(np.ravel(numbers), corners, strict=True)
        ]

    def _refined(self, grey: Image, number: int, corners: Array) -> Array:
        """Corners (4, 2) from all edges of the tag, not from those at its corners alone.

        The affine map from the tag as it is printed to the picture, for which both correlate best (OpenCV's
        findTransformECC; Evangelidis and Psarakis 2008). The corners found are good to half a pixel, these to a tenth.
        """
        template = self._template(number)
        side = template.shape[0] - 2 * CELL
        ends = np.array([[0, 0], [side, 0], [side, side], [0, side]]) + CELL - 0.5
        low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - 4, 0)
        high = np.ceil(corners.max(axis=0)).astype(int) + 5
        part = grey[low[1] : high[1], low[0] : high[0]]
        homogeneous = np.column_stack([ends, np.ones(4)])
        map_found = np.linalg.lstsq(homogeneous, corners - low, rcond=None)[0].T
        start = np.ascontiguousarray(map_found, np.float32)
        pixel = side / max(float(np.hypot(*(corners[1] - corners[0]))), 1.0)  # of the picture
        softened = cv2.GaussianBlur(template, (0, 0), PIXEL_BLUR * pixel)
        try:
            alike, found = cv2.findTransformECC(
                softened, part, start, cv2.MOTION_AFFINE, STEPS, np.full_like(part, 255), 1
            )
        except cv2.error as error:
            if error.code != cv2.Error.StsNoConv:  # no convergence: most of the tag looks otherwise
                raise
            return np.asarray(corners, float)
        refined: Array = homogeneous @ np.asarray(found, float).T + low
        return refined if alike > ALIKE else np.asarray(corners, float)

    def _template(self, number: int) -> Image:
        """The tag with its white rim."""
        if number not in self._templates:
            tag = tag_picture(self._name, number, CELL)
            self._templates[number] = np.pad(tag, CELL, constant_values=255)
        return self._templates[number]

    def _detect(self, grey: Image, side: float) -> tuple[Any, Any]:
        create: Callable[[], Any] = (
            aruco.DetectorParameters_create if OLD else aruco.DetectorParameters
        )
        parameters = create()
        parameters.minMarkerPerimeterRate = min(4.0 * SIDE_LEAST * side / max(grey.shape), 3.9)
        parameters.cornerRefinementMethod = int(aruco.CORNER_REFINE_CONTOUR)
        parameters.perspectiveRemovePixelPerCell = 8  # small tags are read more often than with 4
        if OLD:
            corners, numbers, _ = aruco.detectMarkers(grey, self._table, parameters=parameters)
        else:
            corners, numbers, _ = aruco.ArucoDetector(self._table, parameters).detectMarkers(grey)
        return corners, numbers


def _dictionary(name: str) -> Any:
    if not FINDS_TAGS:
        raise ValueError(
            f"OpenCV {cv2.__version__} is here without its module aruco, which finds tags; install Ubuntu's python3-opencv, or "
            "opencv-contrib-python-headless in the place of opencv-python-headless"
        )
    number = getattr(aruco, PREFIX + name, None)
    if number is None:
        raise ValueError(
            f"no dictionary {name!r}: expected a name of OpenCV's, such as 4X4_50 or APRILTAG_36h11"
        )
    get = aruco.Dictionary_get if OLD else aruco.getPredefinedDictionary
    return get(number)


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
    if not PRINTED_LEAST <= side <= PRINTED_MOST:
        raise ValueError(f"side {side:g} mm: expected {PRINTED_LEAST:g} to {PRINTED_MOST:g}")
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
