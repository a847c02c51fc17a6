# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Calibration recovers a camera that made the pictures, drawn here ray by ray."""

import cv2
import numpy as np
import pytest

from fish_vision import calibrate
from fish_vision.calibrate import lens_from_chessboards, mount_from_points
from fish_vision.calibration import Calibration, CalibrationError, Lens, Mount, undistort

SIZE, SQUARE, CORNERS = (480, 360), 0.05, (7, 5)
TRUE = Lens.from_camera_info(
    *SIZE, "plumb_bob", [400, 0, 243, 0, 404, 176, 0, 0, 1], [-0.2, 0.05, 0.001, -0.001, 0]
)
MOUNT = Mount((0.05, -0.08, 3.2), (-0.022, 0.018, 0.010))


def rays_of_pixels(fine: int) -> np.ndarray:
    """(N, 3) directions of all subpixels: the plumb_bob formula inverted by repeated substitution."""
    u, v = np.meshgrid(np.arange(SIZE[0] * fine), np.arange(SIZE[1] * fine))
    pixels = (np.column_stack([u.ravel(), v.ravel()]) + 0.5) / fine - 0.5
    k1, k2, p1, p2, _ = TRUE.D
    x_d, y_d = ((pixels - TRUE.K[:2, 2]) / np.diag(TRUE.K)[:2]).T
    x, y = x_d, y_d
    for _ in range(15):
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2 * r2
        x, y = (
            (x_d - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial,
            (y_d - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial,
        )
    return np.column_stack([x, y, np.ones(len(x))])


def board_picture(
    rays: np.ndarray, fine: int, rotation: tuple[float, float, float], t: tuple[float, float, float]
) -> np.ndarray:
    """Chessboard seen through the true lens: each subpixel's ray is cut with the board's plane."""
    R = cv2.Rodrigues(np.array(rotation))[0]
    depth = (R[:, 2] @ np.array(t)) / (rays @ R[:, 2])
    board = (rays * depth[:, None] - np.array(t)) @ R[
        :, :2
    ] / SQUARE + 1.0  # in squares; (1, 1) = first corner
    inside = np.all((board > 0) & (board < np.array(CORNERS) + 1), axis=1)
    dark = (np.floor(board).astype(int).sum(axis=1) % 2 == 0) & inside
    grey = np.where(dark, 30, 220).astype(np.uint8).reshape(SIZE[1] * fine, SIZE[0] * fine)
    return cv2.cvtColor(cv2.resize(grey, SIZE, interpolation=cv2.INTER_AREA), cv2.COLOR_GRAY2BGR)


@pytest.fixture(scope="module")
def rays() -> np.ndarray:
    return rays_of_pixels(3)


@pytest.fixture(scope="module")
def pictures(rays: np.ndarray) -> list[np.ndarray]:
    poses = [
        ((0.0, 0.0, 0.0), (-0.15, -0.1, 0.5)),
        ((0.5, 0.0, 0.1), (-0.25, -0.15, 0.6)),
        ((-0.5, 0.1, 0.0), (-0.05, -0.12, 0.55)),
        ((0.1, 0.5, 0.0), (-0.20, -0.02, 0.6)),
        ((0.0, -0.5, 0.2), (-0.10, -0.20, 0.6)),
        ((0.4, 0.4, -0.2), (-0.15, -0.05, 0.5)),
    ]
    return [board_picture(rays, 3, *pose) for pose in poses]


def test_lens_is_recovered_from_chessboards(pictures: list[np.ndarray]) -> None:
    fit = lens_from_chessboards([*pictures, np.zeros_like(pictures[0])], CORNERS, SQUARE)
    lens = fit.lens
    assert fit.used == tuple(range(6))
    assert fit.rms < 0.15
    assert lens.size == SIZE
    assert np.abs(np.vstack(fit.seen) - np.vstack(fit.shown)).max() < 1.0
    u, v = np.meshgrid(np.linspace(60, 420, 9), np.linspace(50, 310, 7))  # where boards were
    pixels = np.column_stack([u.ravel(), v.ravel()])
    error = (undistort(pixels, lens) - undistort(pixels, TRUE)) * 400  # in pixels
    assert np.std(error, axis=0).max() < 0.3  # a common shift is taken up by the mount
    assert np.abs(error.mean(axis=0)).max() < 1.0


def test_a_fisheye_is_recovered_from_chessboards() -> None:
    """Rays of the equidistant formula r = f (theta + k1 theta^3), inverted by repeated substitution."""
    f, k1, fine = 170.0, 0.03, 3
    u, v = np.meshgrid(np.arange(SIZE[0] * fine), np.arange(SIZE[1] * fine))
    x, y = (u.ravel() + 0.5) / fine - 0.5 - 243.0, (v.ravel() + 0.5) / fine - 0.5 - 176.0
    r = np.hypot(x, y)
    theta = r / f
    for _ in range(30):
        theta = r / f / (1 + k1 * theta**2)
    sine = np.sin(theta) / np.maximum(r, 1e-9)
    rays = np.column_stack([x * sine, y * sine, np.cos(theta)])
    rays[:, 2] = np.maximum(rays[:, 2], 1e-3)
    poses = [
        ((0.0, 0.0, 0.0), (-0.15, -0.1, 0.2)),
        ((0.5, 0.0, 0.1), (-0.25, -0.15, 0.25)),
        ((-0.5, 0.1, 0.0), (-0.05, -0.12, 0.25)),
        ((0.1, 0.5, 0.0), (-0.30, -0.02, 0.25)),
        ((0.0, -0.5, 0.2), (-0.00, -0.20, 0.25)),
        ((0.4, 0.4, -0.2), (-0.15, -0.05, 0.2)),
    ]
    pictures = [board_picture(rays, fine, *pose) for pose in poses]
    fit = lens_from_chessboards(pictures, CORNERS, SQUARE, fisheye=True)
    assert fit.lens.model == "equidistant"
    assert len(fit.used) >= 5
    assert fit.rms < 0.4
    assert fit.lens.K[0, 0] == pytest.approx(f, rel=0.01)
    mount, _ = mount_from_points(fit.lens, *corners_and_pixels_of(fit.lens))
    np.testing.assert_allclose(mount.position, MOUNT.position, atol=1e-4)


def corners_and_pixels_of(lens: Lens) -> tuple[np.ndarray, np.ndarray]:
    points = np.array([[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0]])
    return np.column_stack([points, np.zeros(4)]), Calibration(lens, MOUNT).pool_to_pixel(points)


def test_too_few_boards_are_refused(pictures: list[np.ndarray]) -> None:
    with pytest.raises(CalibrationError, match="found in 2 of 3"):
        lens_from_chessboards([*pictures[:2], np.zeros_like(pictures[0])], CORNERS, SQUARE)


@pytest.mark.parametrize("number", [0, 1], ids=["square to the camera", "tilted"])
def test_copies_of_one_picture_are_refused(pictures: list[np.ndarray], number: int) -> None:
    with pytest.raises(CalibrationError, match=r"tilts differ by 0.0 deg.*tilt the board"):
        lens_from_chessboards([pictures[number]] * 4, CORNERS, SQUARE)


def test_boards_that_are_not_tilted_are_refused(rays: np.ndarray) -> None:
    places = [(-0.15, -0.1, 0.5), (-0.25, -0.15, 0.6), (-0.05, -0.12, 0.55), (-0.2, -0.02, 0.6)]
    flat = [board_picture(rays, 3, (0.0, 0.0, 0.0), place) for place in places]
    with pytest.raises(CalibrationError, match=r"tilts differ by .* expected 15 or more"):
        lens_from_chessboards(flat, CORNERS, SQUARE)


def test_an_uncertain_focal_length_is_refused(pictures: list[np.ndarray]) -> None:
    """Two poses, one of them square to the camera: the fit is good, and its focal length is wrong.

    How uncertain it is depends on the version of OpenCV.
    """
    few = [pictures[0], pictures[0], pictures[1], pictures[1]]
    with pytest.raises(
        CalibrationError, match=r"focal length uncertain by [\d.]+ %: expected 3 % at most"
    ):
        lens_from_chessboards(few, CORNERS, SQUARE)


def test_a_usual_set_of_pictures_is_far_from_being_refused(
    pictures: list[np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibrate, "FOCAL_STD_MAX", calibrate.FOCAL_STD_MAX / 20)
    monkeypatch.setattr(calibrate, "TILT_MIN", 3 * calibrate.TILT_MIN)
    fit = lens_from_chessboards(pictures, CORNERS, SQUARE)
    assert fit.used == tuple(range(len(pictures)))


def test_pictures_of_different_sizes_are_refused(pictures: list[np.ndarray]) -> None:
    with pytest.raises(CalibrationError, match="different sizes"):
        lens_from_chessboards([pictures[0], pictures[1][:100]], CORNERS, SQUARE)


def corners_and_pixels(height: float) -> tuple[np.ndarray, np.ndarray]:
    points = np.array(
        [[2.135, 1.065], [-2.135, 1.065], [-2.135, -1.065], [2.135, -1.065], [0.0, 1.065]]
    )
    lens = Lens.from_camera_info(
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07]
    )
    return np.column_stack([points, np.full(5, height)]), Calibration(
        lens, MOUNT, height
    ).pool_to_pixel(points)


@pytest.mark.parametrize("height", [0.0, 0.2])
def test_mount_is_recovered_from_the_pool_corners(height: float) -> None:
    lens = Lens.from_camera_info(
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07]
    )
    mount, rms = mount_from_points(lens, *corners_and_pixels(height))
    np.testing.assert_allclose(mount.position, MOUNT.position, atol=1e-5)
    np.testing.assert_allclose(mount.tilt, MOUNT.tilt, atol=1e-5)
    assert rms < 1e-3


def test_mount_from_points_read_to_a_pixel_is_good_to_millimetres() -> None:
    lens = Lens.from_camera_info(
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07]
    )
    points, pixels = corners_and_pixels(0.0)
    mount, rms = mount_from_points(lens, points, np.round(pixels))
    assert 0.0 < rms < 1.0
    places = Calibration(lens, mount).pixel_to_pool(pixels)
    assert np.abs(places - points[:, :2]).max() < 0.005


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_points_that_are_no_numbers_are_refused(bad: float) -> None:
    points, pixels = corners_and_pixels(0.0)
    pixels[2, 1] = bad
    with pytest.raises(CalibrationError, match="not all finite"):
        mount_from_points(TRUE, points, pixels)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "at least 4"),
        ([[x, 0, 0] for x in range(5)], "one line"),
    ],
)
def test_points_that_fix_no_pose_are_refused(points: list, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        mount_from_points(TRUE, points, [[float(i), 0.0] for i in range(len(points))])


@pytest.mark.parametrize("height", [0.0, 0.2])
def test_a_camera_below_the_points_is_refused(height: float) -> None:
    points, pixels = corners_and_pixels(height)
    lens = Lens.from_camera_info(
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07]
    )
    for mirrored in (points * [1, -1, 1], points[[3, 2, 1, 0, 4]]):
        with pytest.raises(CalibrationError, match=r"not above the points.*is y counted downwards"):
            mount_from_points(lens, mirrored[:4], pixels[:4])


def test_points_that_all_have_the_same_pixel_are_refused() -> None:
    points, pixels = corners_and_pixels(0.0)
    with pytest.raises(CalibrationError, match="no camera sees the points at these pixels"):
        mount_from_points(TRUE, points, np.full_like(pixels, 100.0))
