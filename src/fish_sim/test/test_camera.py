# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The simulated camera: projection, parameters, the fish in the picture, rendering, exposure and delays."""

from dataclasses import asdict
from math import cos, pi, sin
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from fish_sim.camera import (
    CameraConfig,
    CameraModel,
    FishPose,
    FishShape,
    Look,
    Patch,
    PoolRenderer,
)
from fish_sim.camera.fish import FRONT, REAR, joints, markers, patches
from fish_sim.camera.model import FrameClock, History, undistort


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


FILE = Path(__file__).parents[1] / "config" / "camera.yaml"


def test_file_has_exactly_the_parameters_and_their_defaults() -> None:
    values = yaml.safe_load(FILE.read_text())["/**"]["ros__parameters"]
    defaults = {
        k: list(v) if isinstance(v, tuple) else v for k, v in asdict(CameraConfig()).items()
    }
    assert values.keys() == defaults.keys()
    for key, value in values.items():
        assert value == pytest.approx(defaults[key]), key


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("rate_hz", 0.0),
        ("drop_rate", 1.5),
        ("latency_s", -0.1),
        ("jpeg_quality", 0),
        ("focal", (1000.0,)),
        ("distortion", (0.1, float("nan"), 0.0, 0.0, 0.0)),
        ("focal", (-1.0, 1000.0)),
        ("camera_position", (0.0, 0.0, 0.0)),
        ("noise_std", float("nan")),
    ],
)
def test_a_bad_value_is_refused_with_its_name(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        CameraConfig(**{field: value})


SHAPE = FishShape()


def test_straight_tail_lies_behind_the_head() -> None:
    hinges, theta = joints(FishPose(1.0, 0.5, pi / 2, (0.0, 0.0, 0.0)), SHAPE)
    np.testing.assert_allclose(hinges[:, 0], 1.0, atol=1e-12)
    np.testing.assert_allclose(hinges[:, 1], 0.5 - 0.075 - np.arange(4) * 0.07 / 3, atol=1e-12)
    np.testing.assert_allclose(theta, pi / 2)


def test_negative_angle_bends_the_tail_to_the_left() -> None:
    hinges, _ = joints(FishPose(0.0, 0.0, 0.0, (-0.4, 0.0, 0.0)), SHAPE)
    assert np.all(np.diff(hinges[:, 1]) > 0)  # left of a fish that looks along x is +y
    np.testing.assert_allclose(
        hinges[1], [-0.075 - 0.07 / 3 * cos(0.4), 0.07 / 3 * sin(0.4)], atol=1e-12
    )


def test_missing_tail_angles_count_as_straight() -> None:
    np.testing.assert_allclose(
        joints(FishPose(0.1, 0.2, 0.3), SHAPE)[0],
        joints(FishPose(0.1, 0.2, 0.3, (0.0,) * 5), SHAPE)[0],
    )


def test_head_markers_have_their_centre_of_mass_between_them() -> None:
    (front, _, front_colour), (rear, _, rear_colour), *tail = markers(
        FishPose(0.4, -0.3, 2.0), SHAPE
    )
    np.testing.assert_allclose((front + rear) / 2, [0.4, -0.3], atol=1e-12)
    np.testing.assert_allclose(front - rear, 0.09 * np.array([cos(2.0), sin(2.0)]), atol=1e-12)
    assert (front_colour, rear_colour, len(tail)) == (FRONT, REAR, 3)


def test_everything_drawn_is_within_the_length_of_the_fish() -> None:
    points = np.vstack([patch.outline for patch in patches(FishPose(0.0, 0.0, 0.0), SHAPE)])
    assert -0.075 - 0.07 - 0.03 - 1e-9 <= points[:, 0].min()
    assert points[:, 0].max() <= 0.075 + 1e-9


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


def test_history_interpolates_linearly_and_holds_the_ends() -> None:
    history = History()
    history.add(1.0, np.array([0.0, 10.0]))
    history.add(1.1, np.array([1.0, 20.0]))
    np.testing.assert_allclose(history.at(1.025), [0.25, 12.5])
    np.testing.assert_allclose(history.at(0.0), [0.0, 10.0])
    np.testing.assert_allclose(history.at(9.0), [1.0, 20.0])


def test_empty_history_has_no_value() -> None:
    assert History().at(0.0) is None


def test_angles_are_interpolated_the_short_way_round() -> None:
    history = History(angles=(0,))
    history.add(0.0, np.array([pi - 0.1]))
    history.add(1.0, np.array([-pi + 0.1]))
    np.testing.assert_allclose(history.at(0.5), [pi])


def test_a_reset_simulation_forgets_the_past() -> None:
    history = History()
    history.add(50.0, np.array([7.0]))
    history.add(0.0, np.array([1.0]))
    np.testing.assert_allclose(history.at(50.0), [1.0])


def test_old_samples_are_dropped() -> None:
    history = History(span=0.5)
    for k in range(100):
        history.add(0.1 * k, np.array([float(k)]))
    np.testing.assert_allclose(history.at(0.0), [94.0])


def test_frames_come_at_multiples_of_the_period() -> None:
    clock = FrameClock(30.0)
    due = [t for t in (clock.due(0.01 * k) for k in range(100)) if t is not None]
    np.testing.assert_allclose(due, np.arange(30) / 30.0)
    assert clock.skipped == 0


def test_a_late_call_takes_the_newest_frame_and_counts_the_others() -> None:
    clock = FrameClock(10.0)
    assert clock.due(1.0) == pytest.approx(1.0)
    assert clock.due(1.57) == pytest.approx(1.5)
    assert clock.skipped == 4


@pytest.mark.parametrize("time", [0.0, 300.0])
def test_the_clock_follows_a_jump(time: float) -> None:
    clock = FrameClock(10.0)
    clock.due(100.0)
    assert clock.due(time) == pytest.approx(time)
    assert clock.due(time + 0.1) == pytest.approx(time + 0.1)
    assert clock.skipped == 0
