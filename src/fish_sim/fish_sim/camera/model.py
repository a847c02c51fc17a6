# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overhead camera without its picture: pool coordinates to pixels and back, its frames, and where the fish was."""

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]  # float64

R_DOWN = np.diag(
    [1.0, -1.0, -1.0]
)  # optical axes of an untilted camera: right = pool x, down = pool -y


@dataclass(frozen=True)
class CameraModel:
    """Pinhole camera with plumb_bob lens, looking down at the pool.

        p_cam = R p_pool + t,  R = exp([tilt]x) diag(1, -1, -1),  t = -R position
        pixel = K distort(p_cam / z_cam)

    Pixel (0, 0) is the centre of the first pixel. Frame: pool (m) and optical (x right, y down, z ahead).
    Source: pinhole and plumb_bob as in OpenCV and sensor_msgs/CameraInfo.
    """

    size: tuple[int, int]  # width, height, pixels
    focal: tuple[float, ...]  # fx, fy, pixels
    centre: tuple[float, ...]  # cx, cy, pixels
    distortion: tuple[float, ...]  # k1, k2, p1, p2, k3
    position: tuple[float, ...]  # of the optical centre in the pool frame, m
    tilt: tuple[float, ...]  # rotation vector about the optical axes, rad; 0 = straight down

    @property
    def K(self) -> Array:
        """(3, 3) camera matrix."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @property
    def D(self) -> Array:
        """(5,) plumb_bob coefficients."""
        return np.asarray(self.distortion, float)

    @property
    def R(self) -> Array:
        """(3, 3) turns pool vectors into optical ones."""
        return cv2.Rodrigues(np.asarray(self.tilt, float))[0] @ R_DOWN

    @property
    def t(self) -> Array:
        """(3,) pool origin in optical coordinates, m."""
        centre: Array = self.R @ np.asarray(self.position, float)
        return -centre

    @cached_property
    def _optics(self) -> tuple[Array, Array, Array, Array]:
        """Rotation vector, translation, K and D, for OpenCV."""
        return cv2.Rodrigues(self.R)[0], self.t, self.K, self.D

    def project(self, points: ArrayLike) -> Array:
        """(N, 3) points in the pool frame, m -> (N, 2) pixels."""
        points = np.asarray(points, float).reshape(-1, 3)
        return cv2.projectPoints(points, *self._optics)[0].reshape(-1, 2)

    def rays(self, pixels: ArrayLike) -> Array:
        """(N, 2) pixels -> (N, 3) directions in the pool frame (not normalised, optical depth 1)."""
        pixels = np.asarray(pixels, float).reshape(-1, 2)
        flat = undistort((pixels - np.array(self.centre)) / np.array(self.focal), self.distortion)
        return np.column_stack([flat, np.ones(len(flat))]) @ self.R

    def unproject(self, pixels: ArrayLike, height: float = 0.0) -> Array:
        """(N, 2) pixels -> (N, 2) points x, y in the plane z = height of the pool frame, m."""
        rays = self.rays(pixels)
        x, y, z = self.position
        return np.array([x, y]) + rays[:, :2] * ((height - z) / rays[:, 2])[:, None]


def undistort(distorted: Array, distortion: tuple[float, ...], steps: int = 25) -> Array:
    """Inverse of the plumb_bob lens: (N, 2) distorted -> (N, 2) ideal normalised image points.

        x <- (x_d - tangential(x)) / radial(x),  radial = 1 + k1 r^2 + k2 r^4 + k3 r^6

    Error after 25 steps below 1e-9 where the radial part stays above about 0.7. cv2.undistortPoints stops
    after five steps, a tenth of a pixel short at the edge of a wide lens.
    Source: fixed-point iteration, Heikkila and Silven (1997), as in OpenCV.
    """
    k1, k2, p1, p2, k3 = distortion
    x, y = distorted[:, 0].copy(), distorted[:, 1].copy()
    for _ in range(steps):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        x, y = (distorted[:, 0] - dx) / radial, (distorted[:, 1] - dy) / radial
    return np.column_stack([x, y])


JUMP = 1.0  # s without a call after which the frames between are not counted as skipped


class History:
    """The last second of a measured vector, linearly interpolated between its samples.

    Angles among the components (given by index) are unwrapped, so that they are interpolated the short way
    round.
    """

    def __init__(self, angles: tuple[int, ...] = (), span: float = 1.0) -> None:
        self._angles, self._span = list(angles), span
        self._times: deque[float] = deque()
        self._values: deque[Array] = deque()

    def add(self, time: float, value: Array) -> None:
        """Append a sample; a time before the last one (a reset simulation) forgets everything before."""
        value = np.array(value, float)
        if self._times and (time < self._times[-1] or value.shape != self._values[-1].shape):
            self._times.clear()
            self._values.clear()
        if self._values:
            turn = self._values[-1][self._angles] - value[self._angles]
            value[self._angles] += 2 * pi * np.round(turn / (2 * pi))
        self._times.append(time)
        self._values.append(value)
        while self._times[0] < time - self._span:
            self._times.popleft()
            self._values.popleft()

    def at(self, time: float) -> Array | None:
        """Value at a time (s); the first or last sample outside the samples' times, None without any."""
        if not self._times:
            return None
        i = bisect_right(self._times, time)
        if i == 0 or i == len(self._times):
            return self._values[min(i, len(self._times) - 1)]
        t_0, t_1 = self._times[i - 1], self._times[i]
        share = (time - t_0) / (t_1 - t_0)
        return (1.0 - share) * self._values[i - 1] + share * self._values[i]


class FrameClock:
    """Exposure times at a fixed rate: multiples of the period."""

    def __init__(self, rate_hz: float) -> None:
        self._rate = rate_hz
        self._taken: int | None = None  # number of the last frame taken
        self.skipped = 0  # frames that came due together with a later one

    def due(self, time: float) -> float | None:
        """Exposure time (s) of the newest frame not after time that was not taken yet, or None.

        A time that jumps (a reset or paused simulation) starts again.
        """
        frame = int(np.floor(time * self._rate + 1e-6))
        ahead = None if self._taken is None else frame - self._taken
        if ahead in (-1, 0):
            return None
        if ahead is not None and 0 < ahead <= max(1.0, JUMP * self._rate):
            self.skipped += ahead - 1
        self._taken = frame
        return frame / self._rate
