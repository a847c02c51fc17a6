# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rectangles of known sides among the straight edges of a picture, each with the camera's pose that shows it so.

Edges are lines of the ideal image plane: without the lens's distortion.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

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
LINES, LINES_TRIED = 48, 150  # that are kept, and looked at, those with most votes
APART = (3.0, 0.025)  # pixels and rad by which two lines differ as the Hough transform gives them
ONE = (1.5, 0.006)  # and as fitted to the edges
NEAR_LINE = 2.0  # pixels from a line within which edges belong to it

PARALLEL = 0.5  # rad, by which two opposite sides may differ in the picture
SQUARE = 0.05  # cosine of the angle between sides, from lines that are a pixel off
PROPORTION = 0.05  # misfit of the sides' ratio
SMALLEST = 0.05  # share of the picture that the rectangle fills
SUPPORT_SIDE, SUPPORT = (
    0.25,
    0.5,
)  # share of the worst side, and of all, along which the picture has edges
NEAR_EDGE = 2.5  # pixels from an edge that still supports a side
SAMPLES = 48  # points of a side
SAME = 3.0  # pixels between the corners of two rectangles that are one
MOST = 250  # rectangles, the largest first
TRIED = 20000  # largest combinations whose edges are looked at


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
        if len(kept) == LINES_TRIED:
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
    for reach in (2.0 * NEAR_LINE, NEAR_LINE):
        near: NDArray[np.bool_] = np.abs(points @ line[:2] + line[2]) < reach
        if near.sum() < 10:
            return None
        middle = points[near].mean(axis=0)
        normal = np.linalg.svd(points[near] - middle, full_matrices=False)[2][1]
        line = np.append(normal, -normal @ middle)
    return line


@dataclass(frozen=True)
class Rectangle:
    """A rectangle with sides length and width, m, seen by a camera: rotation (3, 3) and translation (3,) of its middle.

    Its axes: x along the length, y along the width, z towards the camera.
    """

    R: Array
    t: Array
    area: float  # of the ideal plane


class Combination(NamedTuple):
    """Two pairs of lines that fit."""

    area: float  # of the ideal plane
    corners: Array  # (4, 2) there
    places: Array  # (4, 3) of the corners in the camera's frame, in a scale of their own
    along: float  # the side between the first two, in that scale
    first: float  # m, of that side
    swapped: bool  # whether that side is the shorter one


def rectangles(lines: Array, ideal: IdealPicture, length: float, width: float) -> list[Rectangle]:
    """Rectangles whose sides lie on lines (N, 3) and show edges, the largest first.

    Two lines meet in the ideal plane at the direction (x, y, 1) that parallel sides share in space. Two pairs of sides
    make a rectangle if the two directions are at right angles and the corners' distances have the ratio of the sides.
    """
    able: list[Combination] = []
    for first, second in ((length, width), (width, length)):
        if able and first == second:
            break
        able += list(_fitting(lines, ideal, first, second, swapped=first != length))
    able.sort(key=lambda combination: -combination.area)
    kept: list[tuple[Rectangle, Array]] = []
    distance = cv2.distanceTransform(255 - ideal.edges, cv2.DIST_L2, 3)
    for combination in able[:TRIED]:
        pixels = ideal.pixels(combination.corners)
        if not _supported(pixels, distance):
            continue
        if all(np.abs(pixels - other).max() > SAME for _, other in kept):
            kept.append((_posed(combination), pixels))
        if len(kept) == MOST:
            break
    return [rectangle for rectangle, _ in kept]


def _fitting(
    lines: Array, ideal: IdealPicture, first: float, second: float, swapped: bool
) -> Iterator[Combination]:
    """Each fitting combination; the sides on the first pair measure `first`."""
    pairs = _opposite(lines)
    if not len(pairs):
        return
    directions = np.cross(lines[pairs[:, 0]], lines[pairs[:, 1]])
    directions /= np.maximum(np.linalg.norm(directions, axis=1), 1e-12)[:, None]
    p, q = np.nonzero(np.triu(np.abs(directions @ directions.T) < SQUARE, 1))
    quads = np.concatenate([pairs[p], pairs[q]], axis=1)
    r_1, r_2 = directions[p], directions[q]
    rays = np.stack(
        [
            np.cross(lines[quads[:, i]], lines[quads[:, j]])
            for i, j in ((0, 2), (0, 3), (1, 3), (1, 2))
        ],
        axis=1,
    )  # (N, 4, 3) of the corners, in turn around the rectangle
    with np.errstate(all="ignore"):
        corners = rays[..., :2] / rays[..., 2:]
        places = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
        normal = np.cross(r_1, r_2)
        places = places / np.einsum("nik,nk->ni", places, normal)[..., None]
        along = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
        across = np.linalg.norm(places[:, 3] - places[:, 0], axis=1)
        fits = np.abs(along / across * second / first - 1.0) < PROPORTION
    span = np.array(ideal.edges.shape[::-1]) / ideal.scale
    area = np.abs(_area(corners))
    with np.errstate(invalid="ignore"):
        fits &= (area > SMALLEST * span.prod()) & (area < 2.0 * span.prod())
    for k in np.flatnonzero(fits):
        yield Combination(float(area[k]), corners[k], places[k], float(along[k]), first, swapped)


def _opposite(lines: Array) -> Array:
    """(P, 2) numbers of lines that may be opposite sides."""
    cosine = np.abs(lines[:, :2] @ lines[:, :2].T)
    i, j = np.nonzero(np.triu(cosine > np.cos(PARALLEL), 1))
    return np.column_stack([i, j])


def _area(corners: Array) -> Array:
    """(N,) signed areas of quadrilaterals (N, 4, 2)."""
    x, y = corners[..., 0], corners[..., 1]
    area: Array = 0.5 * np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)
    return area


def _posed(combination: Combination) -> Rectangle:
    """The rectangle in space, in the scale that its first side fixes."""
    solid = combination.places * (combination.first / combination.along)
    if solid[:, 2].mean() < 0:
        solid = -solid
    sides = solid[1] - solid[0], solid[3] - solid[0]
    x, other = (sides[1], sides[0]) if combination.swapped else sides
    x = x / np.linalg.norm(x)
    z = np.cross(x, other / np.linalg.norm(other))
    z = -np.sign(z[2]) * z / np.linalg.norm(z)  # towards the camera
    R = np.column_stack([x, np.cross(z, x), z])
    flat = solid[:, :2] / solid[:, 2:]
    return Rectangle(R, solid.mean(axis=0), float(np.abs(_area(flat[None]))[0]))


def _supported(pixels: Array, distance: Array) -> bool:
    """Whether the picture has edges along the sides between corners (4, 2)."""
    share = np.linspace(0.02, 0.98, SAMPLES)[:, None]
    shares = []
    for a, b in zip(pixels, np.roll(pixels, -1, axis=0), strict=True):
        u, v = np.round(a + share * (b - a)).astype(int).T
        inside = (u >= 0) & (v >= 0) & (u < distance.shape[1]) & (v < distance.shape[0])
        shares.append(np.sum(distance[v[inside], u[inside]] < NEAR_EDGE) / SAMPLES)
    return min(shares) >= SUPPORT_SIDE and float(np.mean(shares)) >= SUPPORT
