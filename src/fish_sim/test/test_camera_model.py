# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""CameraModel against closed forms written out here and against OpenCV's forward model."""

import cv2
import numpy as np
import pytest

from fish_sim.camera import CameraConfig, CameraModel
from fish_sim.camera.model import undistort


def straight_down(distortion: tuple[float, ...] = (0.0,) * 5) -> CameraModel:
    return CameraModel(
        (1280, 720), (900.0, 905.0), (640.0, 360.0), distortion, (0.3, -0.2, 3.0), (0.0,) * 3
    )


def test_untilted_pinhole_is_a_similar_triangle() -> None:
    pixels = straight_down().project(
        [[0.3, -0.2, 0.0], [1.3, -0.2, 0.0], [0.3, 0.8, 0.0], [0.3, 0.8, 0.5]]
    )
    expected = [[640, 360], [640 + 300, 360], [640, 360 - 905 / 3], [640, 360 - 905 / 2.5]]
    np.testing.assert_allclose(pixels, expected, atol=1e-9)


def test_distortion_follows_the_plumb_bob_formula() -> None:
    k1, k2, p1, p2, k3 = D = (-0.2, 0.05, 0.001, -0.002, 0.003)
    x, y = 0.4, -0.3  # ideal image point of pool (1.5, 0.7) seen from (0.3, -0.2, 3)
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    x_d = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    y_d = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    pixel = straight_down(D).project([[1.5, 0.7, 0.0]])[0]
    np.testing.assert_allclose(pixel, [640 + 900 * x_d, 360 + 905 * y_d], atol=1e-9)


def test_undistort_inverts_opencv_at_the_image_edge() -> None:
    model = CameraConfig().model()
    u, v = np.meshgrid(np.linspace(0, 1279, 9), np.linspace(0, 719, 7))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    flat = undistort((pixels - np.array(model.centre)) / np.array(model.focal), model.distortion)
    solid = np.column_stack([flat, np.ones(len(flat))])
    back = cv2.projectPoints(solid, np.zeros(3), np.zeros(3), model.K, model.D)[0].reshape(-1, 2)
    np.testing.assert_allclose(back, pixels, atol=1e-6)


@pytest.mark.parametrize("height", [0.0, 0.1, -0.6])
def test_unproject_inverts_project(height: float) -> None:
    model = CameraConfig().model()
    points = np.random.default_rng(3).uniform([-2.1, -1.0], [2.1, 1.0], (50, 2))
    pixels = model.project(np.column_stack([points, np.full(50, height)]))
    np.testing.assert_allclose(model.unproject(pixels, height), points, atol=1e-9)


def test_default_camera_sees_the_whole_pool_with_a_margin() -> None:
    corners = [[x, y, 0.0] for x in (-2.135, 2.135) for y in (-1.065, 1.065)]
    pixels = CameraConfig().model().project(corners)
    assert pixels.min() > 20
    assert pixels[:, 0].max() < 1260
    assert pixels[:, 1].max() < 700
