# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Calibration: formulas, calibrating, and the pool's outline.

Against similar triangles and formulas written out here; a camera that made the pictures, drawn here ray by ray, is recovered; the
pool's outline is found in drawn pictures in several lights and lenses, and what must be refused is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from fish_vision import calibrate
from fish_vision.calibrate import lens_from_chessboards, mount_from_points
from fish_vision.calibration import (
    Calibration,
    CalibrationError,
    Lens,
    Mount,
    lens_document,
    project,
    read_lens,
    undistort,
)
from fish_vision.pool_outline import find_pool

WIDE = (-0.26, 0.07, 0.0008, -0.0005, 0.0)
RATIONAL = (0.31, -0.12, 0.0006, -0.0004, 0.02, 0.55, 0.03, -0.01)  # k1 k2 p1 p2 k3 k4 k5 k6
MOUNT = Mount((0.05, -0.08, 3.2), (-0.022, 0.018, 0.010))
FILE = Path(__file__).parents[1] / "config" / "simulated_camera.yaml"

FISHEYE = (0.057, 0.038, -0.025, 0.004)  # k1 .. k4

PLAIN_K = [740.0, 0, 640, 0, 740, 360, 0, 0, 1]
SIZE, SQUARE, CORNERS = (480, 360), 0.05, (7, 5)
TRUE = Lens.from_camera_info(
    *SIZE, "plumb_bob", [400, 0, 243, 0, 404, 176, 0, 0, 1], [-0.2, 0.05, 0.001, -0.001, 0]
)

SIDES = (4.27, 2.13)
POOL_MOUNT = Mount((0.06, -0.09, 3.2), (-0.03, 0.025, 0.02))
WEBCAM = Lens.from_camera_info(
    960,
    540,
    "plumb_bob",
    [750.0, 0, 474, 0, 750.0, 275, 0, 0, 1],
    [-0.26, 0.07, 0.0008, -0.0005, 0],
)
FISHEYE_LENS = Lens.from_camera_info(
    960, 720, "equidistant", [420.0, 0, 484, 0, 420.0, 352, 0, 0, 1], [0.02, -0.01, 0.003, 0.0]
)
DECK, TOP, WALL, FLOOR, GROUT = (
    (112, 116, 118),
    (205, 205, 200),
    (126, 105, 53),
    (196, 172, 96),
    (172, 148, 78),
)
FINE = 3  # subpixels of a pixel in each direction
APPARENT_DEPTH = 0.45  # m, at which refraction shows the floor

Thing = tuple[float, float, float, float, tuple[int, int, int]]  # middle, sides, m, colour
CLUTTER: tuple[Thing, ...] = (
    (-2.3, 1.0, 0.3, 0.5, (40, 60, 180)),  # over a corner
    (0.8, 1.05, 1.3, 0.25, (60, 60, 60)),  # over a third of a side
    (1.2, -0.3, 0.4, 0.4, (30, 200, 220)),  # in the water
    (-0.5, 1.28, 0.9, 0.12, (230, 230, 230)),  # on the deck
    (0.2, -1.2, 0.06, 0.5, (220, 220, 220)),  # a ladder
)


def lens(d: tuple[float, ...] = WIDE, focal: float = 1000.0) -> Lens:
    return Lens.from_camera_info(1280, 720, "plumb_bob", [focal, 0, 634, 0, focal, 366, 0, 0, 1], d)


def test_untilted_pinhole_is_a_similar_triangle() -> None:
    straight = Calibration(lens(()), Mount((0.2, 0.1, 3.0), (0.0, 0.0, 0.0)))
    points = straight.pixel_to_pool([[634, 366], [734, 366], [634, 466]])
    np.testing.assert_allclose(points, [[0.2, 0.1], [0.5, 0.1], [0.2, -0.2]], atol=1e-9)


def test_markers_above_the_water_appear_larger_by_their_height() -> None:
    mount = Mount((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    low, high = Calibration(lens(()), mount), Calibration(lens(()), mount, plane_height=0.3)
    np.testing.assert_allclose(
        high.pixel_to_pool([[900, 500]]), 0.9 * low.pixel_to_pool([[900, 500]])
    )


def test_undistort_inverts_the_plumb_bob_formula_at_the_image_edge() -> None:
    k1, k2, p1, p2, k3 = WIDE
    u, v = np.meshgrid(np.linspace(-0.6, 0.6, 7), np.linspace(-0.35, 0.35, 5))
    x, y = u.ravel(), v.ravel()
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    x_d = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    y_d = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    pixels = np.column_stack([634 + 1000 * x_d, 366 + 1000 * y_d])
    np.testing.assert_allclose(undistort(pixels, lens()), np.column_stack([x, y]), atol=1e-8)


def fisheye_lens() -> Lens:
    K = [400, 0, 634, 0, 404, 366, 0, 0, 1]
    return Lens.from_camera_info(1280, 720, "equidistant", K, FISHEYE)


def test_a_fisheye_follows_the_formula_of_kannala_and_brandt() -> None:
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-1.2, 1.2, 7), np.linspace(-0.7, 0.7, 5)))
    r = np.hypot(u, v)
    angle = np.arctan(r)
    k1, k2, k3, k4 = FISHEYE
    bent = angle * (1 + k1 * angle**2 + k2 * angle**4 + k3 * angle**6 + k4 * angle**8)
    scale = bent / np.where(r > 0, r, 1.0)
    pixels = np.column_stack([634 + 400 * scale * u, 366 + 404 * scale * v])
    np.testing.assert_allclose(
        undistort(pixels, fisheye_lens()), np.column_stack([u, v]), atol=1e-7
    )


def test_a_fisheye_maps_the_pool_there_and_back_and_its_mount_is_found() -> None:
    calibration = Calibration(fisheye_lens(), Mount((0.05, -0.08, 1.9), MOUNT.tilt))
    points = np.array([[-1.9, -0.9], [1.9, -0.9], [1.9, 0.9], [-1.9, 0.9], [0.3, 0.1], [0.0, -0.5]])
    pixels = calibration.pool_to_pixel(points)
    np.testing.assert_allclose(calibration.pixel_to_pool(pixels), points, atol=1e-7)
    solid = np.column_stack([points, np.zeros(len(points))])
    mount, rms = mount_from_points(fisheye_lens(), solid, pixels)
    assert rms < 1e-3
    np.testing.assert_allclose(mount.position, (0.05, -0.08, 1.9), atol=1e-4)


def test_pixels_may_be_columns_of_a_table_with_places() -> None:
    """They lie apart in memory then."""
    calibration = Calibration(fisheye_lens(), MOUNT)
    places = np.array([[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0], [0.0, 0.5]])
    table = np.column_stack([places, calibration.pool_to_pixel(places)])
    np.testing.assert_allclose(calibration.pixel_to_pool(table[:, 2:]), places, atol=1e-6)


def rational_lens() -> Lens:
    return Lens.from_camera_info(
        1280, 720, "rational_polynomial", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], RATIONAL
    )


def test_undistort_inverts_the_rational_formula_too() -> None:
    k1, k2, p1, p2, k3, k4, k5, k6 = RATIONAL
    u, v = np.meshgrid(np.linspace(-0.6, 0.6, 7), np.linspace(-0.35, 0.35, 5))
    x, y = u.ravel(), v.ravel()
    r2 = x * x + y * y
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    x_d = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    y_d = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    pixels = np.column_stack([634 + 1000 * x_d, 366 + 1000 * y_d])
    np.testing.assert_allclose(
        undistort(pixels, rational_lens()), np.column_stack([x, y]), atol=1e-8
    )


def test_a_lens_without_distortion_needs_no_model() -> None:
    bare = Lens.from_camera_info(1280, 720, "", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [])
    np.testing.assert_allclose(
        undistort(np.array([[734.0, 566.0]]), bare), [[0.1, 0.2]], atol=1e-12
    )


@pytest.mark.parametrize("height", [0.0, 0.05])
def test_pixels_and_pool_are_inverse_over_the_whole_pool(height: float) -> None:
    calibration = Calibration(lens(), MOUNT, height)
    x, y = np.meshgrid(np.linspace(-2.1, 2.1, 9), np.linspace(-1.05, 1.05, 7))
    points = np.column_stack([x.ravel(), y.ravel()])
    np.testing.assert_allclose(
        calibration.pixel_to_pool(calibration.pool_to_pixel(points)), points, atol=1e-8
    )


def test_homography_is_the_whole_map_of_a_lens_without_distortion() -> None:
    calibration = Calibration(lens(()), MOUNT)
    x, y, w = calibration.H @ [1.3, -0.7, 1.0]
    np.testing.assert_allclose(calibration.pool_to_pixel([[1.3, -0.7]])[0], [x / w, y / w])


def test_scale_is_the_derivative_of_the_place() -> None:
    calibration = Calibration(lens(), MOUNT)
    pixels, h = np.array([[200.0, 600.0], [900.0, 80.0], [640.0, 360.0]]), 1e-3
    places, J = calibration.place_and_scale(pixels)
    np.testing.assert_allclose(places, calibration.pixel_to_pool(pixels))
    for i, step in enumerate(np.eye(2) * h):
        change = calibration.pixel_to_pool(pixels + step) - calibration.pixel_to_pool(pixels - step)
        np.testing.assert_allclose(J[:, :, i], change / (2 * h), rtol=1e-4, atol=1e-8)


def test_no_points_give_no_points() -> None:
    assert Calibration(lens(), MOUNT).pixel_to_pool(np.zeros((0, 2))).shape == (0, 2)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ((0, 720, "plumb_bob", [1.0] * 9, []), "0 x 720"),
        ((1280, 0, "plumb_bob", [1.0] * 9, []), "1280 x 0"),
        (
            (1280, 720, "plumb_bob", [1e3, 0.0, 640.0, 0.0, 0.0, 360.0, 0.0, 0.0, 1.0], []),
            "1000, 0",
        ),
        (
            (1280, 720, "plumb_bob", [0.0, 0.0, 640.0, 0.0, 1e3, 360.0, 0.0, 0.0, 1.0], []),
            "0, 1000",
        ),
        ((1280, 720, "plumb_bob", [0.0] * 9, [0.0] * 5), "not calibrated"),
        ((1280, 720, "plumb_bob", [float("nan")] * 9, []), "not finite"),
        ((1280, 720, "plumb_bob", [1e-300] * 9, []), "not calibrated"),
        ((1280, 720, "plumb_bob", [1.0] * 4, []), "missing"),
        ((1280, 720, "omnidirectional", PLAIN_K, [0.1] * 4), "omnidirectional"),
        ((1280, 720, "equidistant", PLAIN_K, [0.1] * 5), "5 coefficients"),
        ((1280, 720, "plumb_bob", PLAIN_K, [0.1] * 8), "8 coefficients"),
        ((1280, 720, "rational_polynomial", PLAIN_K, [0.1] * 3), "3 coefficients"),
        ((1280, 720, "plumb_bob", [1e300, *PLAIN_K[1:]], []), r"focal lengths 1e\+300, 740,"),
        ((1280, 720, "plumb_bob", [*PLAIN_K[:4], 3, *PLAIN_K[5:]], []), "focal lengths 740, 3,"),
        ((1280, 720, "plumb_bob", [740, 1e9, *PLAIN_K[2:]], []), "expected fx 0 cx"),
        ((1280, 720, "plumb_bob", [*PLAIN_K[:6], 5, 5, 0], []), "expected fx 0 cx"),
        *(
            ((1280, 720, model, PLAIN_K, d), f"d is .*expected {expected}")
            for model, d, expected in (
                ("plumb_bob", [-0.9, 0, 0, 0, 0], "a distortion in which every corner"),
                ("plumb_bob", [0, 0, 1e200, 0, 0], "a distortion in which every corner"),
                ("equidistant", [-5.0, 0, 0, 0], "a distortion in which every corner"),
                ("plumb_bob", [100.0, 0, 0, 0, 0], "one that shows a corner at most 2 times"),
                ("plumb_bob", [1e6, 0, 0, 0, 0], "one that shows a corner at most 2 times"),
                ("plumb_bob", [0, 0, 0, 0, 1e4], "one that shows a corner at most 2 times"),
                ("rational_polynomial", [0] * 5 + [-5, 0, 0], "one that shows a corner at most 2"),
            )
        ),
    ],
)
def test_unusable_camera_info_is_refused_with_the_reason(fields: tuple, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        Lens.from_camera_info(*fields)


@pytest.mark.parametrize(
    "mount",
    [
        *(
            Mount((x, y, 3.0), (0.0,) * 3)
            for x, y in ((9.0, 0.0), (-9.0, 0.0), (0.0, 9.0), (0.0, -9.0))
        ),
        Mount((0.0, 0.0, 3.0), (3.1, 0.0, 0.0)),
        Mount((0.0, 0.0, -3.0), (0.0, 0.0, 0.0)),
    ],
)
def test_a_mount_that_does_not_see_the_pool_is_refused(mount: Mount) -> None:
    with pytest.raises(CalibrationError, match="camera_position"):
        Calibration(lens(), mount)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_camera_in_the_plane_of_the_markers_is_refused(height: float) -> None:
    with pytest.raises(CalibrationError, match=r"camera_position.*in the plane of the markers"):
        Calibration(lens(), Mount((0.0, 0.0, height), (0.0, 0.0, 0.0)), height)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_camera_under_the_water_is_refused(height: float) -> None:
    """It looks up at the pool's centre, which is in the picture, but mirrored."""
    with pytest.raises(CalibrationError, match=r"in the plane of the markers.*or below it"):
        Calibration(lens(), Mount((0.0, 0.0, -3.0), (np.pi, 0.0, 0.0)), height)


@pytest.mark.parametrize("d", [(0, 0, 1e200, 0, 0), (-0.9, 0, 0, 0, 0), (0, 0, 0, 0, 1e4)])
def test_a_lens_whose_pixels_do_not_come_back_is_refused(d: tuple[float, ...]) -> None:
    straight_down = Mount((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))  # whose pool centre is not distorted
    absurd = Lens((1280, 720), np.reshape(PLAIN_K, (3, 3)), np.array(d, float))
    with pytest.raises(CalibrationError, match="which no lens has") as caught:
        Calibration(absurd, straight_down)
    assert len(str(caught.value)) < 400


def test_a_lens_file_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(lens_document(lens(), "overhead")))
    again = read_lens(path)
    assert again.size == (1280, 720)
    np.testing.assert_array_equal(again.K, lens().K)
    np.testing.assert_array_equal(again.D, lens().D)
    path.write_text(yaml.safe_dump(lens_document(rational_lens(), "overhead")))
    np.testing.assert_array_equal(read_lens(path).D, RATIONAL)
    np.testing.assert_array_equal(read_lens(FILE).K, lens().K)


def test_a_lens_file_has_what_the_camera_driver_publishes() -> None:
    """Undistorted pictures keep the lens's own pixels: nothing is turned or scaled."""
    document = lens_document(lens(), "overhead")
    assert document["distortion_model"] == "plumb_bob"
    assert document["rectification_matrix"]["data"] == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert document["projection_matrix"]["data"] == [1000, 0, 634, 0, 0, 1000, 366, 0, 0, 0, 1, 0]


@pytest.mark.parametrize("text", [None, "", "a: [", "image_width: 3", "[]", "image_width: x"])
def test_a_broken_lens_file_is_refused_with_its_name(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "bad.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(CalibrationError, match=r"bad.yaml"):
        read_lens(path)


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (-0.022, 0.018, 0.010), (0.3, -0.2, 1.0)])
def test_the_quaternion_turns_optical_axes_into_the_pool(tilt: tuple[float, ...]) -> None:
    mount = Mount((0.0, 0.0, 3.0), tilt)
    x, y, z, w = mount.quaternion
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0)
    axis = np.array([x, y, z])
    for column in np.eye(3):  # v + 2 w (q x v) + 2 q x (q x v)
        turned = column + 2.0 * np.cross(axis, np.cross(axis, column) + w * column)
        assert turned == pytest.approx(mount.R.T @ column, abs=1e-9)
    if not any(tilt):
        assert mount.quaternion == pytest.approx((1.0, 0.0, 0.0, 0.0))


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
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07, 0, 0, 0]
    )
    return np.column_stack([points, np.full(5, height)]), Calibration(
        lens, MOUNT, height
    ).pool_to_pixel(points)


@pytest.mark.parametrize("height", [0.0, 0.2])
def test_mount_is_recovered_from_the_pool_corners(height: float) -> None:
    lens = Lens.from_camera_info(
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07, 0, 0, 0]
    )
    mount, rms = mount_from_points(lens, *corners_and_pixels(height))
    np.testing.assert_allclose(mount.position, MOUNT.position, atol=1e-5)
    np.testing.assert_allclose(mount.tilt, MOUNT.tilt, atol=1e-5)
    assert rms < 1e-3


def test_mount_from_points_read_to_a_pixel_is_good_to_millimetres() -> None:
    lens = Lens.from_camera_info(
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07, 0, 0, 0]
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
        1280, 720, "plumb_bob", [1000, 0, 634, 0, 1000, 366, 0, 0, 1], [-0.26, 0.07, 0, 0, 0]
    )
    for mirrored in (points * [1, -1, 1], points[[3, 2, 1, 0, 4]]):
        with pytest.raises(CalibrationError, match=r"not above the points.*is y counted downwards"):
            mount_from_points(lens, mirrored[:4], pixels[:4])


def test_points_that_all_have_the_same_pixel_are_refused() -> None:
    points, pixels = corners_and_pixels(0.0)
    with pytest.raises(CalibrationError, match="no camera sees the points at these pixels"):
        mount_from_points(TRUE, points, np.full_like(pixels, 100.0))


@dataclass(frozen=True)
class View:
    """What is before the camera."""

    lens: Lens = WEBCAM
    mount: Mount = POOL_MOUNT
    pools: Sequence[tuple[float, float]] = ((0.0, 0.0),)  # middles, m
    clutter: Sequence[Thing] = ()
    light: tuple[float, float, float] = (1.0, 1.0, 1.0)  # gains of blue, green, red
    shade: float = 0.0  # share of light that is lost from the left to the right edge
    noise: float = 3.0
    rim: float = 0.05  # m
    tiles: bool = True
    sides: tuple[float, float] = field(default=SIDES)


def picture(view: View) -> np.ndarray:
    """A pool with a rim, walls and a tiled floor, things on the deck and over the rim, light and noise."""
    width, height = view.lens.size
    canvas = np.empty((height * FINE, width * FINE, 3), np.uint8)
    canvas[:] = DECK

    def fill(
        x: float,
        y: float,
        length: float,
        breadth: float,
        colour: tuple[int, int, int],
        z: float = 0.0,
    ) -> None:
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array([length, breadth]) / 2
        share = np.linspace(0, 1, 30, endpoint=False)[:, None]
        ends = np.roll(corners, -1, axis=0)
        line = np.vstack([a + share * (b - a) for a, b in zip(corners, ends, strict=True)]) + [x, y]
        solid = np.column_stack([line, np.full(len(line), z)])
        R = view.mount.R
        pixels = project(solid, cv2.Rodrigues(R)[0], -R @ np.array(view.mount.position), view.lens)
        fine = np.round(((pixels + 0.5) * FINE - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(canvas, [fine], colour, shift=4)

    length, breadth = view.sides
    for x, y in view.pools:
        fill(x, y, length + 2 * view.rim, breadth + 2 * view.rim, TOP)
        fill(x, y, length, breadth, WALL)
        fill(x, y, length, breadth, FLOOR, -APPARENT_DEPTH)
        for line in np.arange(-length / 2, length / 2, 0.305) if view.tiles else ():
            fill(x + line, y, 0.012, breadth, GROUT, -APPARENT_DEPTH)
        for line in np.arange(-breadth / 2, breadth / 2, 0.305) if view.tiles else ():
            fill(x, y + line, length, 0.012, GROUT, -APPARENT_DEPTH)
    for x, y, length, breadth, colour in view.clutter:
        fill(x, y, length, breadth, colour)
    seen = cv2.resize(canvas, view.lens.size, interpolation=cv2.INTER_AREA).astype(float)
    seen *= np.array(view.light) * (1.0 - view.shade * np.linspace(0, 1, width)[:, None])
    seen += np.random.default_rng(1).normal(0.0, view.noise, seen.shape)
    return np.clip(np.round(seen), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("view", "millimetres"),
    [
        (View(), 2.0),
        (View(light=(0.3, 0.3, 0.3)), 3.0),
        (View(light=(0.6, 0.95, 1.2)), 2.0),
        (View(light=(1.3, 1.1, 0.9)), 2.0),
        (View(shade=0.7), 3.0),
        (View(noise=10.0), 4.0),
        (View(clutter=CLUTTER), 3.0),
        (View(lens=FISHEYE_LENS), 4.0),
        (View(lens=FISHEYE_LENS, clutter=CLUTTER, shade=0.5), 5.0),
        (View(mount=Mount((0.5, -0.6, 3.4), (-0.15, 0.1, 0.05))), 4.0),
        (View(rim=0.02), 2.0),
    ],
    ids=[
        "plain",
        "dark",
        "warm",
        "bright",
        "shade",
        "noise",
        "clutter",
        "fisheye",
        "fisheye_clutter",
        "tilted",
        "thin_rim",
    ],
)
def test_the_outline_gives_the_camera_in_any_light_and_lens(view: View, millimetres: float) -> None:
    """Errors are those of the corners as the camera found would place them on the water."""
    found = find_pool(picture(view), view.lens, SIDES, 0.0, "right")
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array(SIDES) / 2
    solid = np.column_stack([corners, np.zeros(4)])
    R, R_found = view.mount.R, found.mount.R
    true = project(solid, cv2.Rodrigues(R)[0], -R @ np.array(view.mount.position), view.lens)
    seen = project(
        solid, cv2.Rodrigues(R_found)[0], -R_found @ np.array(found.mount.position), view.lens
    )
    each_pixel = 1e3 * view.mount.position[2] / view.lens.K[0, 0]  # mm
    assert np.abs(seen - true).max() * each_pixel < millimetres
    assert found.rms < 0.6
    assert np.abs(found.mount.position - np.array(view.mount.position)).max() < 0.02


def test_hidden_parts_of_a_side_are_reported() -> None:
    found = find_pool(picture(View(clutter=CLUTTER)), WEBCAM, SIDES, 0.0, "right")
    above, left, below, right = found.seen  # +y, -x, -y, +x
    assert 0.5 < above < 0.8
    assert 0.6 < left <= 1.0
    assert min(below, right) > 0.9


@pytest.mark.parametrize(("x_points", "turn"), [("right", 0.0), ("left", np.pi)])
def test_x_points_says_which_way_round_the_pool_is(x_points: str, turn: float) -> None:
    found = find_pool(picture(View()), WEBCAM, SIDES, 0.0, x_points)
    ahead = found.mount.R @ [1.0, 0.0, 0.0]
    assert (
        np.arctan2(-ahead[1], ahead[0]) % (2 * np.pi) == pytest.approx(turn, abs=0.05)
        or turn == 0.0
    )
    assert np.sign(ahead[0]) == np.cos(turn)


def test_the_outline_may_lie_above_the_water() -> None:
    found = find_pool(picture(View()), WEBCAM, SIDES, 0.1, "right")
    assert found.mount.position[2] == pytest.approx(POOL_MOUNT.position[2] + 0.1, abs=5e-3)


@pytest.mark.parametrize(
    ("view", "sides", "x_points", "message"),
    [
        (View(pools=()), SIDES, "right", "no rectangle of 4.27 x 2.13 m"),
        (View(pools=((1.4, 0.0),)), SIDES, "right", "no rectangle of 4.27 x 2.13 m"),
        (View(), (5.0, 2.13), "right", "no rectangle of 5 x 2.13 m"),
        (View(clutter=((0.0, 1.05, 4.5, 0.4, (60, 60, 60)),)), SIDES, "right", "no rectangle of"),
        (View(light=(0.02, 0.02, 0.02)), SIDES, "right", "no rectangle of"),
        (
            View(
                pools=((0.0, 1.3), (0.0, -1.3)),
                tiles=False,
                mount=Mount((0.0, 0.0, 7.5), (0.0, 0.0, 0.0)),
            ),
            SIDES,
            "right",
            "more than one rectangle",
        ),
        (View(), SIDES, "up", "degrees off --x-points up one way or the other"),
    ],
    ids=["no pool", "out of view", "another size", "a hidden side", "night", "two pools", "turned"],
)
def test_no_mount_is_better_than_a_wrong_one(
    view: View, sides: tuple[float, float], x_points: str, message: str
) -> None:
    with pytest.raises(CalibrationError, match=message) as refused:
        find_pool(picture(view), view.lens, sides, 0.0, x_points)
    assert "\n" not in str(refused.value)
