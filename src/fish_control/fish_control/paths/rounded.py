# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Polylines with circular fillets: the corners a fish can swim."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# m between points on an arc; leaves a heading error of ARC_STEP / (8 radius) ~ 3e-4 rad
ARC_STEP = 5e-4
EASED_STEP = 2e-3  # m between points of an eased curve
HAIRPIN = np.deg2rad(175.0)  # a corner sharper than this has no useful fillet


def round_corners(vertices: ArrayLike, radius: ArrayLike, closed: bool = False) -> Array:
    """Replace each corner by a circular arc tangent to both sides.

        tangent length = r tan(delta / 2), delta = deflection of the corner

    Radii whose tangents do not fit on a side are reduced in proportion.

    Args:
        vertices: (V, 2) corners [m]; the ends of an open polyline stay where they are.
        radius: wanted radius of the arcs [m], one for all or (V,); 0 leaves a corner sharp.

    Returns:
        (M, 2) dense points [m]; the first is not repeated when closed.
    """
    corners = np.asarray(vertices, dtype=float)
    sides = np.roll(corners, -1, axis=0) - corners  # side i leads from corner i to the next
    length = np.hypot(sides[:, 0], sides[:, 1])
    angle = np.arctan2(sides[:, 1], sides[:, 0])
    turn = np.angle(np.exp(1j * (angle - np.roll(angle, 1))))
    tangent = np.where(np.abs(turn) < HAIRPIN, np.asarray(radius) * np.tan(np.abs(turn) / 2.0), 0.0)
    if not closed:
        tangent[[0, -1]] = 0.0
    fits = np.minimum(1.0, length / np.maximum(tangent + np.roll(tangent, -1), 1e-12))
    tangent = tangent * np.minimum(fits, np.roll(fits, 1))
    return np.vstack(
        [_fillet(corners[i], angle[i - 1], turn[i], tangent[i]) for i in range(len(corners))]
    )


def _fillet(corner: Array, heading: float, turn: float, tangent: float) -> Array:
    """Points of the arc that starts `tangent` [m] before the corner on `heading` and turns by `turn`
    [rad].
    """
    if tangent < ARC_STEP or abs(turn) < 1e-6:
        return corner[None]
    radius = tangent / np.tan(abs(turn) / 2.0)
    normal = heading + np.sign(turn) * np.pi / 2.0
    centre = corner - tangent * _unit(heading) + radius * _unit(normal)
    polar = (
        normal
        + np.pi
        + np.linspace(0.0, turn, max(int(np.ceil(radius * abs(turn) / ARC_STEP)), 4) + 1)
    )
    arc: Array = centre + radius * np.column_stack([np.cos(polar), np.sin(polar)])
    return arc


def _unit(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def ease(points: ArrayLike, width: float, closed: bool = False) -> Array:
    """Smooth along the arc length, so that curvature swells and fades where a straight meets an arc.

    Gaussian of standard deviation `width` [m] on even samples; the ends of an open curve stay where they are.
    An arc of radius r moves inwards by width^2 / (2 r).

    Args:
        points: (M, 2) [m].

    Returns:
        (N, 2) points every 2 mm.
    """
    from scipy.ndimage import gaussian_filter1d  # slow to import, and most nodes ease no path

    vertices = np.asarray(points, dtype=float)
    if closed:
        vertices = np.vstack([vertices, vertices[:1]])
    s = np.r_[0.0, np.cumsum(np.hypot(*np.diff(vertices, axis=0).T))]
    even = np.linspace(0.0, s[-1], int(np.ceil(s[-1] / EASED_STEP)) + 1)
    samples = np.column_stack([np.interp(even, s, vertices[:, k]) for k in range(2)])
    sigma = width / (even[1] - even[0])
    if closed:
        around: Array = gaussian_filter1d(samples[:-1], sigma, axis=0, mode="wrap")
        return around
    reach = min(int(np.ceil(4.0 * sigma)), len(samples) - 1)
    before, after = (
        2.0 * samples[0] - samples[reach:0:-1],
        2.0 * samples[-1] - samples[-2 : -reach - 2 : -1],
    )
    extended: Array = gaussian_filter1d(np.vstack([before, samples, after]), sigma, axis=0)
    return extended[reach : reach + len(samples)]
