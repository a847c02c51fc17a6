# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Colour segmentation: which pixels have a marker's colour, where the middle of each blob is, and that of a marker of known size
of which a part is hidden.
"""

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

RIM_MIN = 0.25  # share of the circle that must be seen, without its ends: a shorter arc leaves the middle open
NEAR = 0.8  # pixels from the circle within which a point of the outline belongs to it
BAND = 1.6  # pixels around the circle whose weights place the middle
SECTORS = 12
WEIGHT_STD = 0.12  # standard deviation of a weight at the rim


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


Array = NDArray[Any]  # float64


def fit_disc(weight: Array, radius: float) -> tuple[float, float, float] | None:
    """Middle and its standard deviation, of a disc whose rim is partly seen, pixels.

        minimise sum (w - clip(radius + 1/2 - |p - c|, 0, 1))^2 over the pixels p at the seen part of the rim

    Pairs of points of the blob's outline vote for the circle of this radius that passes through most of it; the
    outline's other points lie on the edge of what hides the disc. Two Gauss-Newton steps follow.

    Args:
        weight: (h, w) how much of each pixel has the marker's colour, 0 to 1.
        radius: of the whole disc, pixels.

    Returns:
        Column, row, standard deviation, or None where too little of the rim is seen.
    """
    outline, *_ = cv2.findContours(
        (weight > 0.5).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    if not outline:
        return None
    points = max(outline, key=len).reshape(-1, 2).astype(float)
    middle = _voted(points, radius - 0.35)  # the outline runs through the middles of its pixels
    if middle is None:
        return None
    return _refined(weight, points, middle, radius)


def _voted(points: Array, radius: float) -> Array | None:
    """(2,) middle of the circle through most of the points (N, 2)."""
    count = len(points)
    if count < 8:
        return None
    centres = []
    for gap in (count // 8, count // 5, count // 3):
        other = np.roll(points, -max(gap, 2), axis=0)
        half, middle = (other - points) / 2, (other + points) / 2
        length = np.hypot(half[:, 0], half[:, 1])
        fits = (length > 0.2 * radius) & (length < radius)
        away = np.sqrt(radius**2 - length[fits] ** 2) / length[fits]
        across = np.column_stack([-half[fits, 1], half[fits, 0]]) * away[:, None]
        centres += [middle[fits] + across, middle[fits] - across]
    tried = np.vstack(centres)
    if not len(tried):
        return None
    off = np.abs(np.hypot(*(tried[:, None] - points).transpose(2, 0, 1)) - radius)
    best: Array = tried[np.argmax(np.sum(np.maximum(0.0, 1.0 - off / NEAR), axis=1))]
    return best


def _refined(
    weight: Array, points: Array, middle: Array, radius: float
) -> tuple[float, float, float] | None:
    """Gauss-Newton on the weights in the sectors where the outline lies on the circle."""
    rows, columns = np.mgrid[0 : weight.shape[0], 0 : weight.shape[1]]
    places = np.column_stack([columns.ravel(), rows.ravel()]).astype(float)
    values = weight.ravel()
    seen = _sectors(points[np.abs(np.hypot(*(points - middle).T) - radius + 0.35) < NEAR] - middle)
    rim = np.bincount(seen, minlength=SECTORS) > 0
    rim &= np.roll(rim, 1) & np.roll(rim, -1)  # not where the other edge begins
    if rim.sum() < RIM_MIN * SECTORS:
        return None
    information = np.zeros((2, 2))
    for _ in range(3):
        away = places - middle
        distance = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
        use = (np.abs(distance - radius) < BAND) & rim[_sectors(away)]
        inner = radius + 0.5 - distance[use]
        model = np.clip(inner, 0.0, 1.0)
        slope = ((inner > -0.3) & (inner < 1.3))[:, None]  # the lens softens the edge
        J = away[use] / distance[use, None] * slope  # d model / d middle
        information = J.T @ J
        if np.linalg.det(information) < 1.0:
            return None
        step = np.linalg.solve(information, J.T @ (values[use] - model))
        middle = middle + np.clip(step, -1.0, 1.0)
    std = WEIGHT_STD * float(np.sqrt(np.linalg.eigvalsh(np.linalg.inv(information))[-1]))
    return float(middle[0]), float(middle[1]), std


def _sectors(away: Array) -> NDArray[np.int64]:
    """Which part of the circle a direction (N, 2) falls into."""
    angle = np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) % 1.0
    return np.minimum((angle * SECTORS).astype(np.int64), SECTORS - 1)
