# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Square coded markers (ArUco, AprilTag) in a picture, found by OpenCV: the one place that knows its two interfaces."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

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
