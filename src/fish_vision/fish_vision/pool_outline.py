# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The pool's outline found in a picture: a rectangle of known sides, and where the camera hangs above it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, degrees, pi, radians, sin

import cv2
import numpy as np

from fish_vision.calibrate import mount_from_points
from fish_vision.calibration import Array, Calibration, CalibrationError, Lens, Mount, project
from fish_vision.outline_fit import OutlineFit, OutlineFitter
from fish_vision.rectangles import ideal_picture, rectangles, straight_lines
from fish_vision.segmentation import Image

SIDE, ALL = 0.4, 0.7  # share of each side, and of all, along which the edge must be seen
RMS_LIMIT = 0.0015  # share of the picture's longer side
SAME = 0.004  # share of it between the corners of two fits that are one
NEAR = 0.96  # ratio of two outlines' sizes from which on one may be the other edge of the same rim
AGAIN, MORE = 2.0, 0.2  # rms within this factor or these pixels of the best is as good
RIVAL = 0.5  # ratio of sizes from which on an outline next to another is its rival
SQUARE = 0.03  # ratio of the sides to one below which they do not say which of them is x
X_POINTS = {
    "right": 0.0,
    "up": pi / 2,
    "left": pi,
    "down": -pi / 2,
}  # rad, counter-clockwise as the picture shows it
CLEAR = radians(30.0)  # by which x must be nearer to the given way than to the next choice


@dataclass(frozen=True)
class PoolOutline:
    """What is found: the mount, where it shows the corners (4, 2), edge points (N, 2), pixels, their distances from the
    sides, and the share of each side along which its edge is seen.
    """

    mount: Mount
    corners: Array
    points: Array
    rms: float  # pixels
    millimetres: float  # rms on the plane of the outline
    seen: tuple[float, ...]  # +y, -x, -y, +x


def find_pool(
    picture: Image, lens: Lens, sides: tuple[float, float], height: float, x_points: str
) -> PoolOutline:
    """The pool's outline in a picture: the largest rectangle with these sides.

    Edges inside it, such as the floor's, may be rectangles of the same proportions and are smaller. A rim's outer edge has
    other proportions.

    Args:
        picture: (h, w, 3) of the lens's size, distorted as the camera sends it.
        sides: along pool x and y, m.
        height: of the outline above the water, m.
        x_points: where the pool's x axis points in the picture: a key of X_POINTS.

    Raises:
        CalibrationError: no outline, more than one, or an x axis that is not clear.
    """
    length, width = sides
    ideal = ideal_picture(picture, lens)
    found = rectangles(straight_lines(ideal), ideal, length, width)
    fitter = OutlineFitter(picture, lens, length, width)
    fits: list[OutlineFit] = []
    for rectangle in found:
        start = project(fitter.corners, cv2.Rodrigues(rectangle.R)[0], rectangle.t, lens)
        if all(_apart(start, fit.corners) > SAME * max(lens.size) for fit in fits):
            fit = fitter.fit(rectangle.R, rectangle.t)
            fits += [fit] if fit is not None else []
    best = _chosen(fits, lens, sides)
    turned = _turned(fitter.corners, best, lens, sides, x_points)
    pixels = project(turned, best.rotation, best.t, lens)
    places = np.column_stack([fitter.corners[:, :2], np.full(4, height)])
    mount, _ = mount_from_points(lens, places, pixels)
    flat = Calibration(lens, mount, height).pixel_to_pool(best.points)
    half = np.array(sides) / 2
    off = np.abs(np.abs(flat) - half).min(axis=1)
    order = [int(np.argmin(np.abs(fitter.corners - corner).sum(axis=1))) for corner in turned]
    seen = tuple(float(best.seen[k]) for k in order)
    return PoolOutline(
        mount, pixels, best.points, best.rms, 1e3 * float(np.sqrt(np.mean(off**2))), seen
    )


def _chosen(fits: Sequence[OutlineFit], lens: Lens, sides: tuple[float, float]) -> OutlineFit:
    """The outline among rectangles, or CalibrationError."""
    longer, name = max(lens.size), f"{sides[0]:g} x {sides[1]:g} m"
    good = [
        f
        for f in fits
        if f.seen.min() >= SIDE and f.seen.mean() >= ALL and f.rms <= RMS_LIMIT * longer
    ]
    if not good:
        raise CalibrationError(
            f"no rectangle of {name} is seen with an edge along {100 * SIDE:.0f} % of each side: expected the pool's whole "
            "outline in view; check --pool, the lens file and the light, or leave --find out and click the corners"
        )
    largest = max(f.size for f in good)
    best = min((f for f in good if f.size >= NEAR * largest), key=lambda f: f.rms)
    for other in good:
        apart = _apart(other.corners, best.corners)
        next_to_it = (
            cv2.pointPolygonTest(
                best.corners.astype(np.float32), other.corners.mean(axis=0).tolist(), False
            )
            < 0
        )
        rival = other.size >= NEAR * best.size and other.rms < max(
            AGAIN * best.rms, best.rms + MORE
        )
        if apart > SAME * longer and (rival or (next_to_it and other.size >= RIVAL * best.size)):
            raise CalibrationError(
                f"more than one rectangle of {name} is seen, {apart:.0f} pixels apart ({best.rms:.1f} and {other.rms:.1f} "
                "pixels rms): expected one outline; leave --find out and click the corners"
            )
    return best


def _apart(corners: Array, others: Array) -> float:
    """Greatest distance of a corner (4, 2) from the nearest of the others, pixels."""
    return float(np.linalg.norm(corners[:, None] - others, axis=2).min(axis=1).max())


def _turned(
    corners: Array, fit: OutlineFit, lens: Lens, sides: tuple[float, float], x_points: str
) -> Array:
    """Which of the fit's corners are those of the pool (4, 3), whose x axis points as told."""
    wanted = X_POINTS[x_points]
    square = abs(sides[0] / sides[1] - 1.0) < SQUARE
    quarters = (0, 1, 2, 3) if square else (0, 2)
    ways = []
    for quarter in quarters:
        angle = quarter * pi / 2
        ahead = 0.05 * min(sides) * np.array([[0.0, 0.0, 0.0], [cos(angle), sin(angle), 0.0]])
        (u_0, v_0), (u, v) = project(ahead, fit.rotation, fit.t, lens)
        off = abs((np.arctan2(v_0 - v, u - u_0) - wanted + pi) % (2 * pi) - pi)
        ways.append((float(off), quarter))
    (off, quarter), (second, _) = sorted(ways)[:2]
    if second - off < CLEAR:
        raise CalibrationError(
            f"the pool's x axis points {degrees(off):.0f} degrees off --x-points {x_points} one way or the other: expected "
            f"the one of {', '.join(X_POINTS)} that is nearest to it"
        )
    order = np.roll(np.arange(4), -quarter)
    return corners[order]
