# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Calibration against similar triangles and formulas written out here."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from fish_vision.calibrate import mount_from_points
from fish_vision.calibration import (
    Calibration,
    CalibrationError,
    Lens,
    Mount,
    lens_document,
    read_lens,
    undistort,
)

WIDE = (-0.26, 0.07, 0.0008, -0.0005, 0.0)
RATIONAL = (0.31, -0.12, 0.0006, -0.0004, 0.02, 0.55, 0.03, -0.01)  # k1 k2 p1 p2 k3 k4 k5 k6
MOUNT = Mount((0.05, -0.08, 3.2), (-0.022, 0.018, 0.010))
FILE = Path(__file__).parents[1] / "config" / "simulated_camera.yaml"


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


FISHEYE = (0.057, 0.038, -0.025, 0.004)  # k1 .. k4


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
            "1000.0, 0.0",
        ),
        (
            (1280, 720, "plumb_bob", [0.0, 0.0, 640.0, 0.0, 1e3, 360.0, 0.0, 0.0, 1.0], []),
            "0.0, 1000.0",
        ),
        ((1280, 720, "plumb_bob", [0.0] * 9, [0.0] * 5), "not calibrated"),
        ((1280, 720, "plumb_bob", [float("nan")] * 9, []), "not finite"),
        ((1280, 720, "plumb_bob", [1e-300] * 9, []), "not calibrated"),
        ((1280, 720, "plumb_bob", [1.0] * 4, []), "missing"),
        ((1280, 720, "omnidirectional", [1.0] * 9, [0.1] * 4), "omnidirectional"),
        ((1280, 720, "equidistant", [1.0] * 9, [0.1] * 5), "5 coefficients"),
        ((1280, 720, "plumb_bob", [1.0] * 9, [0.1] * 8), "8 coefficients"),
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


def test_a_lens_that_sends_pixels_nowhere_is_refused() -> None:
    d = (0.0, 0.0, 1e200, 0.0, 0.0)
    straight_down = Mount((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))  # whose pool centre is not distorted
    with pytest.raises(CalibrationError, match="which no lens has"):
        Calibration(
            Lens.from_camera_info(1280, 720, "plumb_bob", [1e3, 0, 640, 0, 1e3, 360, 0, 0, 1], d),
            straight_down,
        )


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
