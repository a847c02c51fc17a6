"""Calibrating a camera: its lens from chessboard pictures, its mount from known points of the pool."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike

from fish_vision.calibration import R_DOWN, CalibrationError, Lens, Mount
from fish_vision.segmentation import Image

BOARDS_MIN = 4  # pictures needed to tell lens from board poses
POINTS_MIN = 4


def lens_from_chessboards(
    pictures: Sequence[Image], corners: tuple[int, int], square: float
) -> tuple[Lens, float, list[int]]:
    """Camera matrix and plumb_bob distortion from pictures of a chessboard (Zhang's method, OpenCV).

    k3 stays zero, as in ROS camera_calibration: it runs wild where no board was seen.

    Args:
        pictures: same size, board in different places and tilts, also near the edges.
        corners: inner corners along the board's two sides.
        square: side of one square, m.
    Returns:
        Lens, root mean square reprojection error (pixels), numbers of the pictures in which the board was
        found.
    Raises:
        CalibrationError: pictures of different sizes, or the board in fewer than BOARDS_MIN of them.
    """
    sizes = {picture.shape[1::-1] for picture in pictures}
    if len(sizes) > 1:
        raise CalibrationError(
            f"pictures of different sizes {sorted(sizes)}: expected one camera and one size"
        )
    found = {i: seen for i, p in enumerate(pictures) if (seen := _board(p, corners)) is not None}
    if len(found) < BOARDS_MIN:
        raise CalibrationError(
            f"a board of {corners[0]} x {corners[1]} inner corners was found in {len(found)} of "
            f"{len(pictures)} pictures: expected at least {BOARDS_MIN}; check --corners, light, and that the "
            "whole board is visible"
        )
    grid = np.mgrid[0 : corners[0], 0 : corners[1]].T.reshape(-1, 2) * square
    board = np.column_stack([grid, np.zeros(len(grid))]).astype(np.float32)
    size = sizes.pop()
    boards, places = [board] * len(found), list(found.values())
    rms, K, D, _, _ = cv2.calibrateCamera(boards, places, size, None, None, flags=cv2.CALIB_FIX_K3)
    return Lens(size, np.asarray(K, float), np.asarray(D, float).ravel()[:5]), float(rms), list(found)


def _board(picture: Image, corners: tuple[int, int]) -> np.ndarray | None:
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    found, places = cv2.findChessboardCornersSB(grey, corners, flags=cv2.CALIB_CB_ACCURACY)
    return places.astype(np.float32) if found else None


def mount_from_points(lens: Lens, points: ArrayLike, pixels: ArrayLike) -> tuple[Mount, float]:
    """Where the camera hangs, from points (N, 3) of the pool frame (m) and where they are seen (N, 2),
    pixels.

    Returns:
        Mount, root mean square reprojection error (pixels).
    Raises:
        CalibrationError: fewer than POINTS_MIN points, or points that fix no pose (not
            finite, on one line).
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
    _, rotation, t = cv2.solvePnP(points, pixels, lens.K, lens.D, flags=cv2.SOLVEPNP_SQPNP)
    rotation, t = cv2.solvePnPRefineLM(points, pixels, lens.K, lens.D, rotation, t)
    R = cv2.Rodrigues(rotation)[0]
    seen = cv2.projectPoints(points, rotation, t, lens.K, lens.D)[0].reshape(-1, 2)
    rms = float(np.sqrt(np.mean(np.sum((seen - pixels) ** 2, axis=1))))
    position, tilt = (-R.T @ t).ravel(), cv2.Rodrigues(R @ R_DOWN)[0].ravel()
    return Mount(tuple(map(float, position)), tuple(map(float, tilt))), rms
