# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether the numbers of a calibrated camera are those of a lens: camera matrix, distortion, rectification, projection.

Terms and order of the numbers are those of sensor_msgs/CameraInfo; the distortion's equations are OpenCV's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # float64

# numbers of coefficients that each model may have; none and four of plumb_bob are five with zeros
COEFFICIENTS = {"plumb_bob": (5, 4, 0), "rational_polynomial": (8,), "equidistant": (4,)}
FOCAL_MIN, FOCAL_MAX = 1.0, 1e6  # pixels; a real lens has hundreds to thousands
ASPECT_MAX = 2.0  # fx / fy of a real camera is nearly 1
STRETCH_MAX = (
    2.0  # how much farther from the centre a lens may show a point than it would without distortion
)
OFF_MAX = 0.5  # pixels by which a pixel that is undistorted and distorted again may be off
ROTATION_OFF = 0.01  # by which R times its transpose may differ from the unit matrix
STEPS, NEWTON = 24, 4  # steps from the centre to a corner, and iterations in each


class Fault(NamedTuple):
    """What no calibrated camera has."""

    field: str  # k, d, r or p
    came: str  # "has focal lengths 0, 0"
    expected: str


def matrix_fault(k: Sequence[float]) -> Fault | None:
    """What is wrong with a camera matrix (9 finite numbers, row by row)."""
    said = f"has focal lengths {k[0]:.4g}, {k[4]:.4g}"
    if min(k[0], k[4]) < FOCAL_MIN:
        return Fault("k", said, "those of a calibrated camera")
    if max(k[0], k[4]) >= FOCAL_MAX:
        return Fault("k", said, f"less than {FOCAL_MAX:g} pixels")
    if (k[1], k[3], *k[6:9]) != (0.0, 0.0, 0.0, 0.0, 1.0):
        return Fault("k", f"is {listed(k)}", "fx 0 cx, 0 fy cy, 0 0 1 row by row")
    if not 1.0 / ASPECT_MAX < k[0] / k[4] < ASPECT_MAX:
        return Fault("k", said, f"two of which none is {ASPECT_MAX:g} times the other")
    return None


def distortion_fault(
    size: tuple[int, int], model: str, k: Sequence[float], d: Sequence[float]
) -> Fault | None:
    """What is wrong with distortion coefficients (finite numbers) of a camera whose matrix is right.

    Every corner of the picture must have a ray, and the way to it from the centre must not turn back. Of a fisheye
    these are points half way to the corners, which may see the horizon.

    Args:
        size: width, height, pixels.
        model: a key of COEFFICIENTS.
    """
    if not any(d):
        return None
    focal, centre = np.array([k[0], k[4]]), np.array([k[2], k[5]])
    corners = corners_of(size, model == "equidistant")
    seen = (corners - centre) / focal
    with np.errstate(all="ignore"):
        ideal = np.zeros_like(seen)
        for step in np.linspace(0.0, 1.0, STEPS + 1)[1:]:
            for _ in range(NEWTON):
                at, slope = _distorted(ideal, model, d)
                ideal = (
                    ideal - np.linalg.solve(_usable(slope), (at - step * seen)[..., None])[..., 0]
                )
        off = np.hypot(*((_distorted(ideal, model, d)[0] - seen) * focal).T)
        on_the_way = np.linspace(0.0, 1.0, STEPS)[:, None, None] * ideal
        turns = np.linalg.det(_distorted(on_the_way.reshape(-1, 2), model, d)[1])
        stretch = np.hypot(*seen.T) / np.maximum(np.hypot(*ideal.T), 1e-9)
    if not (off < OFF_MAX).all() or not (turns > 0.0).all():
        expected = "a distortion in which every corner of the picture has a ray of its own"
    elif stretch.max() > STRETCH_MAX:
        expected = f"one that shows a corner at most {STRETCH_MAX:g} times as far out as without it"
    else:
        return None
    return Fault("d", f"is {listed(d)}", f"{expected}; calibrate with the board near the edges too")


def rectification_fault(r: Sequence[float], p: Sequence[float]) -> Fault | None:
    """What is wrong with a rectification (9 finite numbers) or a projection matrix (12), row by row."""
    R = np.reshape(r, (3, 3))
    with np.errstate(all="ignore"):
        off = np.abs(R @ R.T - np.eye(3)).max()
        if not off < ROTATION_OFF or np.linalg.det(R) < 0.0:
            return Fault("r", f"is {listed(r)}", "a rotation; 1 0 0, 0 1 0, 0 0 1 of one camera")
    if not all(FOCAL_MIN <= focal < FOCAL_MAX for focal in (p[0], p[5])):
        said = f"has focal lengths {p[0]:.4g}, {p[5]:.4g}"
        return Fault("p", said, f"{FOCAL_MIN:g} to {FOCAL_MAX:g} pixels")
    if tuple(p[8:12]) != (0.0, 0.0, 1.0, 0.0):
        return Fault("p", f"has the last row {listed(p[8:12])}", "0 0 1 0")
    return None


def corners_of(size: tuple[int, int], fisheye: bool) -> Array:
    """(4, 2) pixels of the picture's corners; of a fisheye points half way to them, as its corners may see the horizon."""
    width, height = size
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], float)
    return 0.5 * (corners + np.array([width, height]) / 2.0) if fisheye else corners


def listed(values: Sequence[float]) -> str:
    """Numbers with four digits each."""
    return f"[{', '.join(f'{value:.4g}' for value in values)}]"


def _distorted(ideal: Array, model: str, d: Sequence[float]) -> tuple[Array, Array]:
    """(N, 2) image points x/z, y/z without distortion -> (N, 2) with it, and (N, 2, 2) derivative."""
    h = 1e-6
    shifts = np.array([[0.0, 0.0], [h, 0.0], [0.0, h]])[:, None]
    x, y = np.moveaxis(ideal + shifts, -1, 0)
    square = x * x + y * y
    if model == "equidistant":
        r = np.sqrt(square)
        angle = np.arctan(r)
        series = angle * np.polyval([*d[3::-1], 1.0], angle**2)
        scale = np.where(r > 1e-9, series / np.maximum(r, 1e-9), 1.0)
        points = np.stack([x * scale, y * scale], axis=-1)
    else:
        k1, k2, p1, p2, k3, k4, k5, k6 = [*d, *[0.0] * (8 - len(d))]
        scale = np.polyval([k3, k2, k1, 1.0], square) / np.polyval([k6, k5, k4, 1.0], square)
        u = x * scale + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
        v = y * scale + 2.0 * p2 * x * y + p1 * (square + 2.0 * y * y)
        points = np.stack([u, v], axis=-1)
    at, right, down = points
    return at, np.stack([right - at, down - at], axis=-1) / h


def _usable(slope: Array) -> Array:
    """The derivatives with those that cannot be inverted replaced, so that the others are solved; their points stay off."""
    bad = ~np.isfinite(slope).all(axis=(1, 2)) | ~(np.abs(np.linalg.det(slope)) > 1e-12)
    return np.where(bad[:, None, None], np.eye(2), slope)
