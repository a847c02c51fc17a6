# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rendered picture: the fish is where the geometry says, noise and glare are what was asked for."""

import cv2
import numpy as np
import pytest

from fish_sim.camera import CameraConfig, FishPose, FishShape, Look, Patch, PoolRenderer, patches
from fish_sim.camera.fish import markers

CONFIG = CameraConfig()
POSE = FishPose(0.7, -0.4, 2.2, (0.2, -0.1, 0.1))
CLEAN = Look(noise_std=0.0, glare=0.0)


@pytest.fixture(scope="module")
def clean() -> PoolRenderer:
    return PoolRenderer(CONFIG.model(), CONFIG.shape(), CLEAN)


def middle_of(picture: np.ndarray, near: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Mean place of a window's pixels, weighted with how much of the colour they have over the black body."""
    u, v = np.round(near).astype(int)
    window = picture[v - 7 : v + 8, u - 7 : u + 8].astype(float)
    target = np.array(colour, float) - 50.0
    weight = np.clip((window - 50.0) @ target / (target @ target), 0.0, 1.0)
    weight[weight < 0.3] = 0.0
    grid = np.mgrid[v - 7 : v + 8, u - 7 : u + 8]
    return np.array([(weight * grid[1]).sum(), (weight * grid[0]).sum()]) / weight.sum()


def test_markers_are_drawn_where_the_camera_projects_them(clean: PoolRenderer) -> None:
    picture = clean.render([POSE], 0.0)
    (front, _, colour), *_ = markers(POSE, CONFIG.shape())
    pixel = clean.camera.project([[*front, 0.0]])[0]
    np.testing.assert_allclose(middle_of(picture, pixel, colour), pixel, atol=0.15)


def test_every_marker_shows_its_colour(clean: PoolRenderer) -> None:
    picture = clean.render([POSE], 0.0).astype(int)
    for centre, _, colour in markers(POSE, CONFIG.shape()):
        u, v = np.round(clean.camera.project([[*centre, 0.0]])[0]).astype(int)
        seen = picture[v, u]
        assert np.argmax(seen) == np.argmax(colour)
        assert np.abs(seen - colour).max() < 40


def test_a_moving_fish_is_drawn_at_the_mean_of_its_poses(clean: PoolRenderer) -> None:
    poses = [FishPose(0.7 + dx, -0.4, 0.0) for dx in (-0.005, 0.0, 0.005)]
    (front, _, colour), *_ = markers(poses[1], CONFIG.shape())
    pixel = clean.camera.project([[*front, 0.0]])[0]
    np.testing.assert_allclose(middle_of(clean.render(poses, 0.0), pixel, colour), pixel, atol=0.2)


@pytest.mark.parametrize("place", [(30.0, 0.0), (2.135, 1.065), (2.3, 0.0)])
def test_a_fish_at_or_beyond_the_edge_is_drawn_without_complaint(
    clean: PoolRenderer, place: tuple
) -> None:
    picture = clean.render([FishPose(*place, 0.3)], 0.0)
    assert picture.shape == (720, 1280, 3)
    assert picture.dtype == np.uint8


def test_another_fish_is_drawn_in_its_own_colours_below_and_a_board_above(
    clean: PoolRenderer,
) -> None:
    green = (30, 200, 30)
    other, shape = FishPose(-0.7, 0.4, 0.0), FishShape(front_colour=green)
    corners = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    board = [Patch(np.array([POSE.x, POSE.y]) + corners, (10, 20, 200))]
    picture = clean.render([POSE], 0.0, below=[patches(other, shape)], above=[board]).astype(int)
    (front, _, colour), *_ = markers(other, shape)
    assert colour == green
    for place, shown in ((front, green), ((POSE.x, POSE.y), (10, 20, 200))):
        u, v = np.round(clean.camera.project([[*place, 0.0]])[0]).astype(int)
        assert np.abs(picture[v, u] - shown).max() < 40


def test_without_a_fish_the_pool_is_empty(clean: PoolRenderer) -> None:
    empty, far = clean.render([], 1.0), clean.render([FishPose(30.0, 0.0, 0.0)], 1.0)
    np.testing.assert_array_equal(empty, far)
    assert np.abs(clean.render([POSE], 1.0).astype(int) - empty).max() > 100


def test_noise_has_the_asked_standard_deviation(clean: PoolRenderer) -> None:
    noisy = PoolRenderer(CONFIG.model(), CONFIG.shape(), Look(noise_std=4.0, glare=0.0))
    noise = noisy.render([POSE], 0.0).astype(float) - clean.render([POSE], 0.0)
    assert noise.std() == pytest.approx(4.0, rel=0.03)
    assert abs(noise.mean()) < 0.1


def test_glare_saturates_only_when_asked(clean: PoolRenderer) -> None:
    glaring = PoolRenderer(CONFIG.model(), CONFIG.shape(), Look(noise_std=0.0, glare=1.0)).render(
        [], 0.5
    )
    assert (glaring.min(axis=2) > 240).mean() > 1e-3
    assert not np.any(clean.render([], 0.5).min(axis=2) > 240)


def test_water_moves_and_the_loop_closes(clean: PoolRenderer) -> None:
    at_0, later, at_period = (clean.render([], t) for t in (0.0, 0.5, 4.0))
    assert np.abs(later.astype(int) - at_0).mean() > 1.0
    np.testing.assert_array_equal(at_0, at_period)


def test_the_same_seed_gives_the_same_pictures() -> None:
    def pictures(seed: int) -> list[np.ndarray]:
        renderer = PoolRenderer(CONFIG.model(), CONFIG.shape(), Look(seed=seed))
        return [renderer.render([POSE], 0.1 * k) for k in range(2)]

    for one, two in zip(pictures(5), pictures(5), strict=True):
        np.testing.assert_array_equal(one, two)
    assert np.any(pictures(5)[0] != pictures(6)[0])


def test_jpeg_keeps_the_picture(clean: PoolRenderer) -> None:
    picture = clean.render([POSE], 0.0)
    decoded = cv2.imdecode(np.frombuffer(clean.jpeg(picture), np.uint8), cv2.IMREAD_COLOR)
    assert cv2.PSNR(picture, decoded) > 35.0
