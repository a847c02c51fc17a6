"""Calibration against similar triangles and formulas written out here."""

from pathlib import Path

import numpy as np
import pytest
import yaml

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
    np.testing.assert_allclose(high.pixel_to_pool([[900, 500]]), 0.9 * low.pixel_to_pool([[900, 500]]))


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
    pixel, h = np.array([200.0, 600.0]), 1e-3
    _, J = calibration.place_and_scale([pixel])
    for i, step in enumerate(np.eye(2) * h):
        ends = calibration.pixel_to_pool([pixel + step, pixel - step])
        np.testing.assert_allclose(J[0][:, i], (ends[0] - ends[1]) / (2 * h), rtol=1e-4, atol=1e-8)


def test_no_points_give_no_points() -> None:
    assert Calibration(lens(), MOUNT).pixel_to_pool(np.zeros((0, 2))).shape == (0, 2)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ((0, 720, "plumb_bob", [1.0] * 9, []), "0 x 720"),
        ((1280, 720, "plumb_bob", [0.0] * 9, [0.0] * 5), "not calibrated"),
        ((1280, 720, "plumb_bob", [float("nan")] * 9, []), "not finite"),
        ((1280, 720, "plumb_bob", [1e-300] * 9, []), "not calibrated"),
        ((1280, 720, "plumb_bob", [1.0] * 4, []), "missing"),
        ((1280, 720, "equidistant", [1.0] * 9, [0.1] * 4), "equidistant"),
        ((1280, 720, "plumb_bob", [1.0] * 9, [0.1] * 8), "8 coefficients"),
    ],
)
def test_unusable_camera_info_is_refused_with_the_reason(fields: tuple, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        Lens.from_camera_info(*fields)


@pytest.mark.parametrize(
    "mount", [Mount((9.0, 0.0, 3.0), (0.0,) * 3), Mount((0.0, 0.0, 3.0), (3.1, 0.0, 0.0))]
)
def test_a_mount_that_does_not_see_the_pool_is_refused(mount: Mount) -> None:
    with pytest.raises(CalibrationError, match="camera_position"):
        Calibration(lens(), mount)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_camera_in_the_plane_of_the_markers_is_refused(height: float) -> None:
    with pytest.raises(CalibrationError, match="camera_position.*in the plane of the markers"):
        Calibration(lens(), Mount((0.0, 0.0, height), (0.0, 0.0, 0.0)), height)


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
    np.testing.assert_array_equal(again.K, lens().K)
    np.testing.assert_array_equal(again.D, lens().D)
    np.testing.assert_array_equal(read_lens(FILE).K, lens().K)


@pytest.mark.parametrize("text", [None, "", "a: [", "image_width: 3", "[]", "image_width: x"])
def test_a_broken_lens_file_is_refused_with_its_name(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "bad.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(CalibrationError, match="bad.yaml"):
        read_lens(path)
