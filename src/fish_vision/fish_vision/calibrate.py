# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Calibrating a camera: its lens from chessboard pictures, its mount from points of the pool whose places are known."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from fish_vision.calibration import (
    NEAREST,
    POOL,
    R_DOWN,
    Array,
    CalibrationError,
    Lens,
    Mount,
    project,
    undistort,
)
from fish_vision.segmentation import Image

BOARDS_MIN = 4  # pictures needed to tell lens from board poses
TILT_MIN = 15.0  # deg between two of the boards: alike ones fit a lens of any focal length
FOCAL_STD_MAX = 0.03  # share of the focal length; a usual set of pictures gives less than 0.005
POINTS_MIN = 4

FORMATS = (("x", "y", "u", "v"), ("id", "x", "y"), ("x", "y"))


@dataclass(frozen=True)
class LensFit:
    """A lens and how well it fits: root mean square reprojection error, and for each board found its corners (N, 2) as
    they were seen and as the lens shows them, pixels; numbers of the pictures with a board.
    """

    lens: Lens
    rms: float
    seen: tuple[Array, ...]
    shown: tuple[Array, ...]
    used: tuple[int, ...]


def lens_from_chessboards(
    pictures: Sequence[Image], corners: tuple[int, int], square: float, fisheye: bool = False
) -> LensFit:
    """Camera matrix and distortion from pictures of a chessboard (Zhang's method, OpenCV).

    The distortion model is plumb_bob, where k3 stays zero, as in ROS camera_calibration: it runs wild where no board
    was seen. With fisheye it is equidistant (Kannala and Brandt 2006).

    Args:
        pictures: same size, board in different places and tilts, also near the edges.
        corners: inner corners along the board's two sides.
        square: side of one square, m.
        fisheye: whether the lens is one of about 120 degrees or more.

    Raises:
        CalibrationError: pictures of different sizes, the board in fewer than BOARDS_MIN of them, or boards
            that leave the focal length open.
    """
    sizes = {picture.shape[1::-1] for picture in pictures}
    if len(sizes) > 1:
        raise CalibrationError(
            f"pictures of different sizes {sorted(sizes)}: expected one camera and one size"
        )
    found = {
        i: seen for i, p in enumerate(pictures) if (seen := find_board(p, corners)) is not None
    }
    if len(found) < BOARDS_MIN:
        raise CalibrationError(
            f"a board of {corners[0]} x {corners[1]} inner corners was found in {len(found)} of "
            f"{len(pictures)} pictures: expected at least {BOARDS_MIN}; check --corners, light, and that the "
            "whole board is visible"
        )
    grid = np.mgrid[0 : corners[0], 0 : corners[1]].T.reshape(-1, 2) * square
    board = np.column_stack([grid, np.zeros(len(grid))])
    places, size = list(found.values()), sizes.pop()
    fit = _fisheye if fisheye else _plumb_bob
    lens, rotations, shifts = fit(board, places, size)
    shown = tuple(project(board, r, t, lens) for r, t in zip(rotations, shifts, strict=True))
    at = tuple(place.reshape(-1, 2).astype(float) for place in places)
    off = np.vstack(at) - np.vstack(shown)
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    return LensFit(lens, rms, at, shown, tuple(found))


def _plumb_bob(
    board: Array, places: Sequence[Array], size: tuple[int, int]
) -> tuple[Lens, Sequence[Array], Sequence[Array]]:
    """Lens and each board's rotation and translation."""
    boards = [board.astype(np.float32)] * len(places)
    _, K, D, rotations, shifts, deviations, *_ = cv2.calibrateCameraExtended(
        boards, places, size, np.eye(3), np.zeros(5), flags=cv2.CALIB_FIX_K3
    )
    lens = Lens(size, np.asarray(K, float), np.asarray(D, float).ravel()[:5])
    _check_tilts(rotations)
    _check_focal_length(lens.K, np.asarray(deviations, float).ravel())
    return lens, rotations, shifts


def _fisheye(
    board: Array, places: Sequence[Array], size: tuple[int, int]
) -> tuple[Lens, Sequence[Array], Sequence[Array]]:
    """Lens and each board's rotation and translation. OpenCV gives no uncertainty for it."""
    boards = [board.reshape(1, -1, 3)] * len(places)
    seen = [place.reshape(1, -1, 2).astype(float) for place in places]
    flag: Any = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2  # OpenCV before 5
    flags = flag.CALIB_RECOMPUTE_EXTRINSIC | flag.CALIB_FIX_SKEW
    try:
        _, K, D, rotations, shifts = cv2.fisheye.calibrate(
            boards, seen, size, np.eye(3), np.zeros((4, 1)), flags=flags
        )
    except cv2.error as error:
        raise CalibrationError(
            f"no fisheye lens fits these boards ({error.err}): leave --fisheye out for a usual lens, or take more pictures "
            "with the board also near the edges"
        ) from error
    _check_tilts(rotations)
    return Lens(size, np.asarray(K, float), np.asarray(D, float).ravel(), True), rotations, shifts


def _check_tilts(rotations: Sequence[Array]) -> None:
    """Refuse boards that are all tilted alike.

    Standard deviations do not show it: copies of one picture, or boards square to the camera, lead into a narrow
    minimum far from the lens, with a small error and a small deviation.
    """
    normals = np.array([cv2.Rodrigues(rotation)[0][:, 2] for rotation in rotations])
    tilt = float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0).min())))
    if not tilt >= TILT_MIN:
        raise CalibrationError(
            f"the boards' tilts differ by {tilt:.1f} deg at most: expected {TILT_MIN:.0f} or more; tilt the board, "
            "20 to 45 deg, to another side in every picture"
        )


def _check_focal_length(K: Array, deviations: Array) -> None:
    """Refuse boards that are tilted too little for the focal length to be known."""
    share = float(np.max(deviations[:2] / np.diag(K)[:2]))  # of fx, fy
    if not share <= FOCAL_STD_MAX:
        raise CalibrationError(
            f"the pictures leave the focal length uncertain by {100 * share:.1f} %: expected "
            f"{100 * FOCAL_STD_MAX:.0f} % at most; tilt the board more and take more pictures"
        )


def find_board(picture: Image, corners: tuple[int, int]) -> np.ndarray | None:
    """(N, 1, 2) inner corners of the chessboard in a picture, pixels, or None."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    found, places = cv2.findChessboardCornersSB(grey, corners, flags=cv2.CALIB_CB_ACCURACY)
    return places.astype(np.float32) if found else None


def mount_from_points(lens: Lens, points: ArrayLike, pixels: ArrayLike) -> tuple[Mount, float]:
    """Where the camera hangs, from points (N, 3) of the pool frame (m) and where they are seen (N, 2),
    pixels.

    Returns:
        Mount, root mean square reprojection error (pixels).

    Raises:
        CalibrationError: fewer than POINTS_MIN points, points that fix no pose (not finite, on one line), or
            a camera that is not above all of them.
    """
    points = np.ascontiguousarray(points, float).reshape(-1, 3)
    pixels = np.ascontiguousarray(pixels, float).reshape(-1, 2)
    if len(points) != len(pixels) or len(points) < POINTS_MIN:
        raise CalibrationError(
            f"{len(points)} points and {len(pixels)} pixels: expected pairs, at least {POINTS_MIN}"
        )
    if not (np.isfinite(points).all() and np.isfinite(pixels).all()):
        raise CalibrationError("points or pixels are not all finite: expected numbers")
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-6) < 2:
        raise CalibrationError("all points lie on one line: expected points spread over the pool")
    try:
        # a fisheye's rays are found first; the other models weigh every pixel alike
        if lens.fisheye:
            seen_at, K, D = undistort(pixels, lens), np.eye(3), np.zeros(5)
        else:
            seen_at, K, D = pixels, lens.K, lens.D
        _, rotation, t = cv2.solvePnP(points, seen_at, K, D, flags=cv2.SOLVEPNP_SQPNP)
        rotation, t = cv2.solvePnPRefineLM(points, seen_at, K, D, rotation, t)
    except cv2.error as error:
        raise CalibrationError(
            f"no camera sees the points at these pixels ({error.err}): expected each point's own pixel"
        ) from error
    R = cv2.Rodrigues(rotation)[0]
    seen = project(points, rotation, t, lens)
    rms = float(np.sqrt(np.mean(np.sum((seen - pixels) ** 2, axis=1))))
    position, tilt = (-R.T @ t).ravel(), cv2.Rodrigues(R @ R_DOWN)[0].ravel()
    highest = float(points[:, 2].max())
    if not position[2] - highest >= NEAREST:
        raise CalibrationError(
            f"the camera comes out at z = {position[2]:.3f} m, not above the points at {highest:.3f} m: is y counted "
            "downwards, or are the points in another order than the pixels?"
        )
    return Mount(tuple(map(float, position)), tuple(map(float, tilt))), rms


@dataclass(frozen=True)
class KnownPoints:
    """Names, places (N, 2) in the pool frame, m, and pixels (N, 2) where they are known; tags: the names are numbers."""

    names: tuple[str, ...]
    places: Array
    pixels: Array | None = None
    tags: bool = False

    def at(self, pixels: Mapping[str, tuple[float, float]]) -> "KnownPoints":
        """Those points that are seen, name -> u, v, with their pixels."""
        chosen = [i for i, name in enumerate(self.names) if name in pixels]
        names = tuple(self.names[i] for i in chosen)
        seen = np.array([pixels[name] for name in names]).reshape(-1, 2)
        return KnownPoints(names, self.places[chosen], seen, self.tags)


def pool_corners(sides: tuple[float, float] = POOL) -> KnownPoints:
    """The corners of the walls' inner faces at the water; sides: along x and y, m."""
    x, y = sides[0] / 2, sides[1] / 2
    places = np.array([[x, y], [-x, y], [-x, -y], [x, -y]])
    return KnownPoints(tuple(_name(place) for place in places), places)


def read_points(path: Path) -> KnownPoints:
    """Points from a CSV file with header x,y,u,v or id,x,y or x,y.

    Raises:
        CalibrationError: no such file, another header, a line with more or fewer fields, or a value that is no finite number.
    """
    lines: list[int] = []
    rows: list[list[float]] = []
    try:
        with path.open(
            newline="", encoding="utf-8-sig"
        ) as file:  # spreadsheets write a byte order mark
            table = csv.reader(file)
            header = [name.strip() for name in next(table, [])]
            form = next((f for f in FORMATS if set(f) <= set(header)), None)
            if form is None or any(header.count(name) > 1 for name in form):
                raise ValueError(f"header {','.join(header)}")
            places = [header.index(name) for name in form]
            for row in filter(any, table):
                lines.append(table.line_num)
                if len(row) != len(header):
                    raise ValueError(
                        f"line {lines[-1]} has {len(row)} fields for {len(header)} names"
                    )
                rows.append([float(row[k]) for k in places])
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise CalibrationError(
            f"{path}: expected CSV with header x,y,u,v or id,x,y or x,y, commas between fields and numbers with points"
            f" ({error})"
        ) from error
    values = np.array(rows).reshape(-1, len(form))
    if not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values).all(axis=1)))
        raise CalibrationError(f"{path}: line {lines[k]} has {rows[k]}: expected finite numbers")
    if form[0] == "id":
        if (values[:, 0] % 1).any():
            raise CalibrationError(f"{path}: an id is no whole number; expected those of the tags")
        return KnownPoints(tuple(str(int(v)) for v in values[:, 0]), values[:, 1:], tags=True)
    pixels = values[:, 2:] if len(form) == 4 else None
    return KnownPoints(tuple(_name(place) for place in values[:, :2]), values[:, :2], pixels)


def _name(place: Array) -> str:
    return f"{place[0]:+.3f} {place[1]:+.3f}"
