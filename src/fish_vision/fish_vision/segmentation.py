# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Colour segmentation: which pixels have a marker's colour, and where the middle of each blob is."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[Any]  # uint8, (h, w, 3) or (h, w)
Box = tuple[int, int, int, int]  # left, top, right, bottom; pixels, right and bottom excluded

PAD = 2  # pixels around a blob that may still hold some of its colour
HUES = 180  # OpenCV's hue counts half degrees
HUE_SLACK = 8  # half degrees by which the hue at a blob's edge may leave its range
MOST = 24  # blobs of a colour that are measured, so that a picture full of specks costs no more
FAINT = 0.25  # share of a blob's colourfulness below which a pixel counts as none of it


@dataclass(frozen=True)
class ColourRange:
    """Hue range (0 to 179, half degrees; low > high wraps), least saturation and value (0 to 255)."""

    hue_low: int
    hue_high: int
    saturation_min: int
    value_min: int

    def mask(self, hsv: Image) -> Image:
        """255 where the pixel is in the range."""
        s, v = self.saturation_min, self.value_min
        if self.hue_low <= self.hue_high:
            return cv2.inRange(hsv, (self.hue_low, s, v), (self.hue_high, 255, 255))
        low = cv2.inRange(hsv, (0, s, v), (self.hue_high, 255, 255))
        return cv2.bitwise_or(low, cv2.inRange(hsv, (self.hue_low, s, v), (HUES - 1, 255, 255)))

    def near(self, hue: Image) -> NDArray[np.bool_]:
        """Where the hue is in the range or within HUE_SLACK of it."""
        return self._near_hues[hue]

    @cached_property
    def _near_hues(self) -> NDArray[np.bool_]:
        """(256,) for every hue whether it is near."""
        width = (self.hue_high - self.hue_low) % HUES + 2 * HUE_SLACK
        near: NDArray[np.bool_] = (np.arange(256) - self.hue_low + HUE_SLACK) % HUES <= width
        return near


@dataclass(frozen=True)
class Blob:
    """One coloured spot: middle and area, in pixels; partly covered pixels count in part."""

    u: float
    v: float
    area: float
    corner: tuple[int, int] = (0, 0)  # first pixel of weight
    # (h, w) how much of each pixel has the marker's colour
    weight: Image | None = field(default=None, repr=False, compare=False)


def hsv_of(image: Image, box: Box) -> Image:
    """Hue, saturation, value of a part of the image."""
    left, top, right, bottom = box
    return cv2.cvtColor(image[top:bottom, left:right], cv2.COLOR_BGR2HSV)


def find_blobs(hsv: Image, colour: ColourRange, area_range: tuple[float, float]) -> list[Blob]:
    """Blobs of a colour with areas in the range, largest first.

    A contour around the pixels in range gives the place; the middle is the mean of all pixels in and around
    it weighted with their colourfulness S V (linear in how much of the pixel the marker covers, when the fish
    under it is grey), so that it is far finer than a pixel. Glare is white: it has no colourfulness and falls
    out.

    Args:
        hsv: (h, w, 3) part of an image.
        area_range: least and greatest area, pixels.
    """
    mask = colour.mask(hsv)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    boxes = [cv2.boundingRect(contour) for contour in contours]
    side = 4.0 * np.sqrt(area_range[1])  # of a box that may still hold a blob in the range
    boxes = [
        box for box in boxes if max(box[2:]) <= side and 2.0 * box[2] * box[3] >= area_range[0]
    ]
    boxes = sorted(boxes, key=lambda box: -box[2] * box[3])[:MOST]
    blobs = [_measure(hsv, mask, colour, (x, y, x + w, y + h)) for x, y, w, h in boxes]
    blobs = [blob for blob in blobs if area_range[0] <= blob.area <= area_range[1]]
    return sorted(blobs, key=lambda blob: -blob.area)


def _measure(hsv: Image, mask: Image, colour: ColourRange, box: Box) -> Blob:
    """Weighted middle of one blob, see find_blobs."""
    left, top = max(box[0] - PAD, 0), max(box[1] - PAD, 0)
    right, bottom = min(box[2] + PAD, hsv.shape[1]), min(box[3] + PAD, hsv.shape[0])
    part = hsv[top:bottom, left:right]
    colourful = np.multiply(part[..., 1], part[..., 2], dtype=np.float32)
    inside = colourful[mask[top:bottom, left:right] != 0]
    full = float(np.partition(inside, len(inside) // 2)[len(inside) // 2])  # the median
    weight = np.minimum(colourful / full, 1.0) * colour.near(part[..., 0])
    weight[weight < FAINT] = 0.0
    columns, rows = weight.sum(axis=0), weight.sum(axis=1)
    area = float(columns.sum())
    u = float(columns @ np.arange(left, right)) / area
    v = float(rows @ np.arange(top, bottom)) / area
    return Blob(u, v, area, (left, top), weight)


def around(points: NDArray[np.float64], size: Sequence[int]) -> Box:
    """Smallest box inside an image of size (width, height) that holds all points (N, 2), pixels."""
    low, high = (
        np.floor(points.min(axis=0)).astype(int),
        np.ceil(points.max(axis=0)).astype(int) + 1,
    )
    width, height = size
    return (
        int(np.clip(low[0], 0, width)),
        int(np.clip(low[1], 0, height)),
        int(np.clip(high[0], 0, width)),
        int(np.clip(high[1], 0, height)),
    )
