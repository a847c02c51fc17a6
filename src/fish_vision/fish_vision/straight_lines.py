# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The straight edges in a picture, as lines of the ideal image plane: without the lens's distortion."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fish_vision.calibration import Array, Lens, project, undistort
from fish_vision.segmentation import Image

WIDEST = (
    1.6  # x/z and y/z at most: what a fisheye sees beyond 58 degrees would need an endless picture
)
SIDE = 1400  # pixels, longer side of the ideal picture
STEEP, OVER_NOISE = (
    20.0,
    7.0,
)  # least gradient of an edge as Canny measures it, and its ratio to the usual one
VOTES = 0.12  # share of the shorter side that must show an edge along a line
LINES, TRIED = 48, 150  # that are kept, and looked at, those with most votes
APART = (3.0, 0.025)  # pixels and rad by which two lines differ as the Hough transform gives them
ONE = (1.5, 0.006)  # and as fitted to the edges
NEAR = 2.0  # pixels from a line within which edges belong to it


@dataclass(frozen=True)
class IdealPicture:
    """A picture without distortion, and how its pixels lie in the ideal image plane x/z, y/z."""

    edges: Image  # (h, w) 255 where the picture changes
    origin: Array  # (2,) ideal point of the middle of pixel (0, 0)
    scale: float  # pixels for 1 of the ideal plane

    def pixels(self, ideal: Array) -> Array:
        """(..., 2) ideal points -> pixels of this picture."""
        return (ideal - self.origin) * self.scale


def ideal_picture(picture: Image, lens: Lens) -> IdealPicture:
    """The picture as a lens without distortion would show it, and its edges (Canny)."""
    low, high = _extent(lens)
    scale = SIDE / float((high - low).max())
    width, height = np.ceil((high - low) * scale).astype(int).tolist()
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    flat = np.column_stack([columns.ravel(), rows.ravel()]) / scale + low
    rays = np.column_stack([flat, np.ones(len(flat))])
    at = project(rays, np.zeros(3), np.zeros(3), lens).reshape(height, width, 2).astype(np.float32)
    beyond = np.any((at < 0) | (at > np.array(lens.size) - 1), axis=-1)
    outside: Image = np.asarray(beyond, np.uint8)
    smooth = cv2.GaussianBlur(picture, (0, 0), max(0.8, 0.5 * lens.K[0, 0] / scale))
    ideal = cv2.remap(smooth, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    edges = np.zeros((height, width), np.uint8)
    for channel in cv2.split(ideal):
        high_change = max(STEEP, OVER_NOISE * float(np.median(_changes(channel, outside))))
        edges |= cv2.Canny(channel, 0.4 * high_change, high_change, L2gradient=True)
    edges[cv2.dilate(outside, np.ones((7, 7), np.uint8)) > 0] = 0
    return IdealPicture(edges, low, scale)


def _changes(channel: Image, outside: Image) -> Array:
    """(N,) size of the gradient as Canny measures it, of the pixels that the camera saw."""
    u, v = (cv2.Sobel(channel, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    changes: Array = np.hypot(u, v)[outside == 0]
    return changes[::7]


def _extent(lens: Lens) -> tuple[Array, Array]:
    """Least and greatest ideal point (2,) that the picture shows."""
    width, height = lens.size
    u, v = np.linspace(0, width - 1, 40), np.linspace(0, height - 1, 40)
    middle = np.array([lens.K[0, 2], lens.K[1, 2]])
    border = [np.column_stack([u, np.full(40, edge)]) for edge in (0, height - 1)]
    border += [np.column_stack([np.full(40, edge), v]) for edge in (0, width - 1)]
    reach = np.vstack(border)
    with np.errstate(all="ignore"):
        flat = undistort(reach, lens)
    # a fisheye's corner may see the horizon: what lies outward there counts as the widest
    bad = ~np.isfinite(flat).all(axis=1) | ((flat * (reach - middle)).sum(axis=1) <= 0)
    flat[bad] = np.sign(reach - middle)[bad] * WIDEST
    return np.maximum(flat.min(axis=0), -WIDEST), np.minimum(flat.max(axis=0), WIDEST)


def straight_lines(ideal: IdealPicture) -> Array:
    """(N, 3) lines a x + b y + c = 0 of the ideal plane with a^2 + b^2 = 1, those with most edges first.

    Hough transform over all edges, so that a line may be interrupted; then total least squares of the edges near each.
    """
    least = int(VOTES * min(ideal.edges.shape))
    found = cv2.HoughLines(ideal.edges, 1.0, np.pi / 720, least)
    if found is None:
        return np.zeros((0, 3))
    rows, columns = np.nonzero(ideal.edges)
    points = np.column_stack([columns, rows]).astype(float)
    lines: list[Array] = []
    middle = np.array(ideal.edges.shape[::-1]) / 2
    for rho, theta in _distinct(found.reshape(-1, found.shape[-1])[:, :2].astype(float)):
        line = _fitted(points, np.array([np.cos(theta), np.sin(theta), -rho]))
        if line is not None and not any(_alike(line, other, middle) for other in lines):
            lines.append(line)
        if len(lines) == LINES:
            break
    pixels = np.array(lines).reshape(-1, 3)
    # a u + b v + c with u = (x - x_0) s
    offset = pixels[:, :2] @ -ideal.origin + pixels[:, 2] / ideal.scale
    return np.column_stack([pixels[:, :2], offset])


def _distinct(found: Array) -> list[Any]:
    """(rho, theta) of lines that differ, in order."""
    kept: list[Any] = []
    for line in found:
        same = False
        for other in kept:
            turn = abs(line[1] - other[1])
            opposite = turn > np.pi / 2  # the line of theta + pi and -rho is the same
            turn = np.pi - turn if opposite else turn
            apart = abs(line[0] + other[0]) if opposite else abs(line[0] - other[0])
            same = same or (turn < APART[1] and apart < APART[0])
        if not same:
            kept.append(line)
        if len(kept) == TRIED:
            break
    return kept


def _alike(line: Array, other: Array, middle: Array) -> bool:
    """Whether two lines (3,) are nearly one where they pass the picture's middle (2,)."""
    sign = np.sign(line[:2] @ other[:2])
    turn = np.linalg.norm(line[:2] - sign * other[:2])
    apart = abs(line[:2] @ middle + line[2] - sign * (other[:2] @ middle + other[2]))
    return bool(turn < ONE[1] and apart < ONE[0])


def _fitted(points: Array, line: Array) -> Array | None:
    """The line (3,) through the points (N, 2) near one."""
    for reach in (2.0 * NEAR, NEAR):
        near: NDArray[np.bool_] = np.abs(points @ line[:2] + line[2]) < reach
        if near.sum() < 10:
            return None
        middle = points[near].mean(axis=0)
        normal = np.linalg.svd(points[near] - middle, full_matrices=False)[2][1]
        line = np.append(normal, -normal @ middle)
    return line
