# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pixels to metres in the pool's plane: lens, camera pose, and the files that hold them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_node.camera_file import (
    IDENTITY,
    CameraFile,
    CameraFileError,
    read_camera_file,
    to_document,
)
from fish_node.lens_check import (
    COEFFICIENTS,
    OFF_MAX,
    corners_of,
    distortion_fault,
    listed,
    matrix_fault,
)
from fish_node.pool import LENGTH, WIDTH

Array = NDArray[Any]  # float64

R_DOWN = np.diag(
    [1.0, -1.0, -1.0]
)  # optical axes of an untilted camera: right = pool x, down = pool -y
POOL = (LENGTH, WIDTH)  # m, along pool x and y
NEAREST = 0.01  # m from the camera down to the plane of the markers


class CalibrationError(ValueError):
    """A calibration that cannot be used; the message says what came and what was expected."""


@dataclass(frozen=True)
class Lens:
    """What sensor_msgs/CameraInfo says of a camera: image size (pixels), camera matrix (3, 3), distortion.

    fisheye: the distortion is that of distortion model equidistant (Kannala and Brandt 2006).
    """

    size: tuple[int, int]  # width, height
    K: Array
    D: Array
    fisheye: bool = False

    @property
    def model(self) -> str:
        """Name of the distortion model."""
        if self.fisheye:
            return "equidistant"
        return "plumb_bob" if len(self.D) == 5 else "rational_polynomial"

    def scaled(self, factor: float) -> "Lens":
        """The lens with focal lengths times a factor."""
        return replace(
            self, K=self.K * np.array([[factor, 1.0, 1.0], [1.0, factor, 1.0], [1.0] * 3])
        )

    @classmethod
    def from_camera_info(
        cls, width: int, height: int, model: str, k: Sequence[float], d: Sequence[float]
    ) -> "Lens":
        """Check and take over the fields of a CameraInfo message (k has 9 numbers, row by row).

        Raises:
            CalibrationError: sizes, model or numbers that no calibrated camera has.
        """
        if width <= 0 or height <= 0:
            raise CalibrationError(
                f"camera_info has image size {width} x {height}: expected positive numbers"
            )
        if len(k) != 9 or not all(isfinite(v) for v in [*k, *d]):
            raise CalibrationError("camera_info has numbers missing or not finite in k or d")
        if fault := matrix_fault(k):
            raise CalibrationError(
                f"camera_info: k {fault.came}, expected {fault.expected}: the camera is not calibrated; run calibrate"
            )
        if len(d) and len(d) not in COEFFICIENTS.get(model, ()):
            counts = {name: count[0] for name, count in COEFFICIENTS.items()}
            raise CalibrationError(
                f"camera_info has distortion model {model!r} with {len(d)} coefficients: expected {counts}"
            )
        if fault := distortion_fault((width, height), model, k, d):
            raise CalibrationError(f"camera_info: d {fault.came}, expected {fault.expected}")
        fisheye = model == "equidistant"
        D = np.zeros(4 if fisheye else 5 if len(d) <= 5 else 8)
        D[: len(d)] = d
        return cls((width, height), np.array(k, float).reshape(3, 3), D, fisheye)


@dataclass(frozen=True)
class Mount:
    """Where the camera hangs: optical centre in the pool frame (m) and tilt (rotation vector about the
    optical axes,
    rad; zero looks straight down with pool x to the right of the image).

        p_cam = R (p_pool - position),  R = exp([tilt]x) diag(1, -1, -1)
    """

    position: tuple[float, ...]
    tilt: tuple[float, ...]

    @property
    def R(self) -> Array:
        """(3, 3) turns pool vectors into optical ones."""
        return cv2.Rodrigues(np.asarray(self.tilt, float))[0] @ R_DOWN

    @property
    def quaternion(self) -> tuple[float, ...]:
        """Orientation of the camera's optical frame in the pool: x, y, z, w."""
        turn = cv2.Rodrigues(self.R.T)[0].ravel()
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle > 0.0 else turn
        return (*map(float, axis * np.sin(angle / 2)), float(np.cos(angle / 2)))


class Calibration:
    """Maps pixels to the plane z = plane_height of the pool frame and back.

    plane_height is that of the markers above the pool frame's origin (the water's surface), m. Without lens
    distortion the map would be one homography; it is kept as `H` (pool plane -> ideal pixels).
    """

    def __init__(self, lens: Lens, mount: Mount, plane_height: float = 0.0) -> None:
        self.lens, self.plane_height = lens, plane_height
        # from below the picture is mirrored, and every turn with it
        if mount.position[2] - plane_height < NEAREST:
            raise CalibrationError(
                f"camera_position = {list(mount.position)} lies in the plane of the markers, z = {plane_height}, "
                "or below it: expected the place of the camera above the pool; run calibrate"
            )
        R = mount.R
        t = -R @ np.asarray(mount.position, float)
        self._rotation = cv2.Rodrigues(R)[0]
        self._t = t
        self._plane = np.column_stack(
            [R[:, 0], R[:, 1], R[:, 2] * plane_height + t]
        )  # pool plane -> ideal image
        self._plane_inverse = np.linalg.inv(self._plane)
        self.H = lens.K @ self._plane
        self._check_pool_visible()
        self._check_lens_invertible()

    def _check_pool_visible(self) -> None:
        """The pool's centre must be in the image, or lens and mount belong to different cameras."""
        (u, v), (width, height) = self.pool_to_pixel([[0.0, 0.0]])[0], self.lens.size
        ahead = self._plane[2, 2] > 0
        if not (ahead and 0 <= u < width and 0 <= v < height):
            raise CalibrationError(
                f"the pool's centre falls on pixel ({u:.0f}, {v:.0f}) of a {width} x {height} image: "
                "camera_info and camera_position / camera_tilt do not belong together; run calibrate"
            )

    def _check_lens_invertible(self) -> None:
        """Every pixel must have a ray that leads back to it, or the poses were wrong without a word."""
        lens = self.lens
        middle = np.array(lens.size) / 2.0
        corners = corners_of(lens.size, lens.fisheye) - middle
        pixels = middle + (np.array([0.25, 0.5, 0.75, 1.0])[:, None, None] * corners).reshape(-1, 2)
        with np.errstate(all="ignore"):
            off = np.hypot(*(_distort(undistort(pixels, lens), lens) - pixels).T)
        if not (off < OFF_MAX).all():
            raise CalibrationError(
                f"camera_info has focal lengths {lens.K[0, 0]:.4g}, {lens.K[1, 1]:.4g} and distortion "
                f"{listed(lens.D.tolist())}, which no lens has: a pixel that is undistorted and distorted again is up to "
                f"{off.max():.4g} pixels off, expected less than {OFF_MAX:g}; run calibrate"
            )

    def pool_to_pixel(self, points: ArrayLike) -> Array:
        """(N, 2) x, y in the markers' plane, m -> (N, 2) pixels."""
        points = np.asarray(points, float).reshape(-1, 2)
        solid = np.column_stack([points, np.full(len(points), self.plane_height)])
        return project(solid, self._rotation, self._t, self.lens)

    def pixel_to_pool(self, pixels: ArrayLike) -> Array:
        """(N, 2) pixels -> (N, 2) x, y in the markers' plane, m."""
        flat = undistort(np.asarray(pixels, float).reshape(-1, 2), self.lens)
        plane: Array = np.column_stack([flat, np.ones(len(flat))]) @ self._plane_inverse.T
        return plane[:, :2] / plane[:, 2:]

    def place_and_scale(self, pixels: ArrayLike) -> tuple[Array, Array]:
        """(N, 2) pixels -> (N, 2) x, y, m, and (N, 2, 2) derivative by u (first column) and v, m/pixel."""
        pixels = np.asarray(pixels, float).reshape(-1, 2)
        cross = np.array([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
        points = self.pixel_to_pool((pixels[:, None] + cross).reshape(-1, 2)).reshape(-1, 5, 2)
        return points[:, 0], np.stack(
            [points[:, 1] - points[:, 2], points[:, 3] - points[:, 4]], axis=-1
        )


def undistort(pixels: Array, lens: Lens) -> Array:
    """(N, 2) pixels -> (N, 2) ideal image points x/z, y/z.

    OpenCV's five fixed-point steps leave up to a tenth of a pixel at the edge of a wide lens; two Newton
    steps with a numerical derivative of OpenCV's own forward model bring it below 1e-6.
    """
    if len(pixels) == 0:
        return np.zeros((0, 2))
    pixels = np.ascontiguousarray(
        pixels
    )  # OpenCV reads columns of a wider array wrongly for a fisheye
    ideal = cv2.fisheye.undistortPoints if lens.fisheye else cv2.undistortPoints
    flat: Array = ideal(pixels.reshape(-1, 1, 2), lens.K, lens.D).reshape(-1, 2)
    h = 1e-6
    shifts = np.array([[0.0, 0.0], [h, 0.0], [0.0, h]])[:, None]
    for _ in range(2):
        at, du, dv = _distort((flat + shifts).reshape(-1, 2), lens).reshape(3, -1, 2)
        (a, c), (b, d), (y_1, y_2) = (du - at).T / h, (dv - at).T / h, (at - pixels).T
        flat = (
            flat
            - np.stack([d * y_1 - b * y_2, a * y_2 - c * y_1], axis=1) / (a * d - b * c)[:, None]
        )
    return flat


def _distort(flat: Array, lens: Lens) -> Array:
    solid = np.column_stack([flat, np.ones(len(flat))])
    return project(solid, np.zeros(3), np.zeros(3), lens)


def project(points: Array, rotation: Array, t: Array, lens: Lens) -> Array:
    """(N, 3) points, m -> (N, 2) pixels of a camera with this rotation vector and translation."""
    rotation, t = np.reshape(rotation, (3, 1)), np.reshape(t, (3, 1))
    if lens.fisheye:
        pixels = cv2.fisheye.projectPoints(points.reshape(-1, 1, 3), rotation, t, lens.K, lens.D)[0]
    else:
        pixels = cv2.projectPoints(points, rotation, t, lens.K, lens.D)[0]
    return pixels.reshape(-1, 2)


def read_lens(path: Path) -> Lens:
    """Lens from a camera calibration file (of camera_info_manager, camera_calibration, OpenCV or `calibrate lens`)."""
    try:
        camera = read_camera_file(path)
        return Lens.from_camera_info(
            camera.width, camera.height, camera.model, camera.camera_matrix, camera.distortion
        )
    except CameraFileError as error:
        raise CalibrationError(str(error)) from error


def lens_document(lens: Lens, camera_name: str) -> Mapping[str, Any]:
    """The lens in the form that `read_lens` and camera_info_manager read."""
    matrices = lens.K, lens.D, np.column_stack([lens.K, np.zeros(3)])
    K, D, P = (tuple(map(float, np.ravel(values))) for values in matrices)
    return to_document(CameraFile(*lens.size, lens.model, D, K, IDENTITY, P), camera_name)
