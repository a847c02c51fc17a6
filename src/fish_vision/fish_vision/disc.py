# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The middle of a marker of known size of which a part is hidden."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # float64

RIM_MIN = 0.25  # share of the circle that must be seen, without its ends: a shorter arc leaves the middle open
NEAR = 0.8  # pixels from the circle within which a point of the outline belongs to it
BAND = 1.6  # pixels around the circle whose weights place the middle
SECTORS = 12
WEIGHT_STD = 0.12  # standard deviation of a weight at the rim


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
