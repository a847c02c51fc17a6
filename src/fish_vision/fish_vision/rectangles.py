# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rectangles of known sides among the straight lines of a picture, each with the camera's pose that shows it so."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from fish_vision.calibration import Array
from fish_vision.straight_lines import IdealPicture

PARALLEL = 0.5  # rad, by which two opposite sides may differ in the picture
SQUARE = 0.05  # cosine of the angle between sides, from lines that are a pixel off
PROPORTION = 0.05  # misfit of the sides' ratio
SMALLEST = 0.05  # share of the picture that the rectangle fills
SUPPORT_SIDE, SUPPORT = (
    0.25,
    0.5,
)  # share of the worst side, and of all, along which the picture has edges
NEAR = 2.5  # pixels from an edge that still supports a side
SAMPLES = 48  # points of a side
SAME = 3.0  # pixels between the corners of two rectangles that are one
MOST = 250  # rectangles, the largest first
TRIED = 20000  # largest combinations whose edges are looked at


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
        shares.append(np.sum(distance[v[inside], u[inside]] < NEAR) / SAMPLES)
    return min(shares) >= SUPPORT_SIDE and float(np.mean(shares)) >= SUPPORT
