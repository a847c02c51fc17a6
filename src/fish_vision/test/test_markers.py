# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""From a picture's pixels to the markers and the pose.

Blobs of discs drawn here with exact antialiasing (many subpixels); ranges that follow the light; photographs of real cameras
(data/README.md) with tags, coloured discs, a chessboard; markers to pose with exact recovery, covariance against finite
differences, identities.
"""

from math import cos, pi, sin
from pathlib import Path

import cv2
import numpy as np
import pytest
from pool_picture import CONFIG

from fish_vision.calibrate import lens_from_chessboards
from fish_vision.pose import (
    HeadPose,
    MarkerLayout,
    Spot,
    head_pose,
    tail_angles,
    tail_sides,
    wrap,
)
from fish_vision.segmentation import ColourRange, around, find_blobs, hsv_of
from fish_vision.spots import MARKERS, Colours, middle
from fish_vision.tags import TagDetector

RED = ColourRange(172, 12, 110, 80)
YELLOW = ColourRange(20, 36, 110, 90)
BGR = {"red": (35, 55, 240), "yellow": (0, 215, 255), "white": (255, 255, 255)}

DATA = Path(__file__).parent / "data"
SHEET = {  # middles of the tags on the printed sheet, in units of its picture's pixels
    23: (1075.6, 544.5),
    40: (1363.5, 1336.5),
    62: (590.3, 947.4),
    98: (1707.5, 1018.6),
    124: (1593.4, 342.4),
    203: (490.5, 305.5),
}

LAYOUT = MarkerLayout((0.045, 0.0), (-0.045, 0.0), 0.075, 0.0233)
ODD = MarkerLayout((0.06, 0.012), (-0.03, -0.004), 0.075, 0.0233)


def picture(
    discs: list[tuple[float, float, float, str]], ground: int = 55, noise: float = 0.0
) -> np.ndarray:
    """(40, 60, 3) grey picture with discs (u, v, radius, colour), 16 x 16 subpixels per pixel."""
    fine = 16
    u = (np.arange(60 * fine) + 0.5) / fine - 0.5
    v = (np.arange(40 * fine) + 0.5) / fine - 0.5
    result = np.full((40, 60, 3), float(ground))
    for u_0, v_0, radius, colour in discs:
        inside = ((u[None, :] - u_0) ** 2 + (v[:, None] - v_0) ** 2 < radius**2).astype(float)
        cover = inside.reshape(40, fine, 60, fine).mean(axis=(1, 3))[..., None]
        result = result * (1 - cover) + np.array(BGR[colour]) * cover
    result += np.random.default_rng(1).normal(0.0, noise, result.shape)
    return np.clip(np.round(result), 0, 255).astype(np.uint8)


def blobs(
    image: np.ndarray, colour: ColourRange, area: tuple[float, float] = (10.0, 300.0)
) -> list:
    return find_blobs(hsv_of(image, (0, 0, image.shape[1], image.shape[0])), colour, area)


@pytest.mark.parametrize("shift", [0.0, 0.23, 0.5, 0.81])
@pytest.mark.parametrize("radius", [2.5, 4.8])
def test_middle_is_found_far_finer_than_a_pixel(shift: float, radius: float) -> None:
    [blob] = blobs(picture([(30 + shift, 20 - shift, radius, "yellow")], noise=3.0), YELLOW)
    assert blob.u == pytest.approx(30 + shift, abs=0.07)
    assert blob.v == pytest.approx(20 - shift, abs=0.07)
    assert blob.area == pytest.approx(np.pi * radius**2, rel=0.15)


def test_hue_range_may_wrap_through_red() -> None:
    image = picture([(20, 20, 5, "red"), (45, 20, 5, "yellow")])
    [red] = blobs(image, RED)
    [yellow] = blobs(image, YELLOW)
    assert red.u == pytest.approx(20, abs=0.05)
    assert yellow.u == pytest.approx(45, abs=0.05)


def test_glare_has_no_colour() -> None:
    assert not blobs(picture([(20, 20, 6, "white")]), YELLOW)
    [blob] = blobs(picture([(30, 20, 5, "yellow"), (34, 20, 3, "white")]), YELLOW)
    assert blob.area < 0.8 * np.pi * 25  # the part under the glare is missing, not counted


def test_blobs_out_of_the_area_range_are_left_out_and_the_largest_is_first() -> None:
    image = picture([(8, 20, 1.2, "yellow"), (22, 20, 4, "yellow"), (42, 20, 5, "yellow")])
    assert [round(b.u) for b in blobs(image, YELLOW)] == [42, 22]
    assert not blobs(np.full((40, 60, 3), BGR["yellow"], np.uint8), YELLOW)


def test_a_blob_at_the_edge_is_measured_as_far_as_it_is_seen() -> None:
    [blob] = blobs(picture([(0, 20, 5, "yellow")]), YELLOW)
    assert 0.0 < blob.u < 4.0
    assert blob.v == pytest.approx(20, abs=0.05)


def test_pictures_of_noise_do_no_harm() -> None:
    noise = np.random.default_rng(2).integers(0, 256, (80, 80, 3)).astype(np.uint8)
    for colour in (RED, YELLOW):
        assert all(np.isfinite([b.u, b.v, b.area]).all() for b in blobs(noise, colour, (1.0, 1e4)))


def test_box_is_cut_at_the_image() -> None:
    assert around(np.array([[-5.0, 3.2], [20.0, 900.0]]), (100, 50)) == (0, 3, 21, 50)
    left, top, right, bottom = around(np.array([[200.0, 200.0], [210.0, 210.0]]), (100, 50))
    assert left >= right or top >= bottom


@pytest.mark.parametrize(
    ("colour", "expected"),
    [
        (YELLOW, range(12, 45)),
        (RED, [*range(164, 180), *range(21)]),
        (ColourRange(2, 10, 0, 0), [*range(19), *range(174, 180)]),
    ],
)
def test_hues_at_the_edge_of_a_blob_may_leave_the_range_by_a_little(
    colour: ColourRange, expected: list[int]
) -> None:
    near = colour.near(np.arange(180, dtype=np.uint8))
    assert set(np.flatnonzero(near)) == set(
        expected
    )  # 8 half degrees either side, round the circle


def test_mask_agrees_with_a_slow_comparison() -> None:
    hsv = cv2.cvtColor(
        np.random.default_rng(4).integers(0, 256, (30, 30, 3)).astype(np.uint8), cv2.COLOR_BGR2HSV
    )
    h, s, v = (hsv[..., i].astype(int) for i in range(3))
    expected = ((h >= 172) | (h <= 12)) & (s >= 110) & (v >= 80)
    np.testing.assert_array_equal(RED.mask(hsv) > 0, expected)


def taught(pictures: int, shift: float, value: float) -> Colours:
    """Ranges after pictures in which every marker has its hue moved and this value."""
    colours = Colours(CONFIG)
    for _ in range(pictures):
        for marker in MARKERS:
            colours.learn(marker, (middle(CONFIG.colour(marker)) + shift) % 180, value)
    return colours


def test_the_first_pictures_teach_more_than_later_ones() -> None:
    """A marker at the edge of its range is seen now and then: a few sights must do."""
    few, many = taught(5, 10.0, 200.0), taught(200, 10.0, 200.0)
    assert all(7.0 < few.shifts[m] < 10.0 for m in MARKERS)
    assert all(many.shifts[m] == pytest.approx(10.0, abs=0.1) for m in MARKERS)
    assert not few.settled
    assert many.settled


def test_a_range_begins_at_half_the_value_of_its_marker_in_bright_and_dark_light() -> None:
    """A dark hull of the marker's hue is then no part of the marker."""
    for value, least in ((255.0, 128), (120.0, 60), (60.0, 40)):
        colours = taught(200, 0.0, value)
        assert all(abs(colours.range(m).value_min - least) <= 1 for m in MARKERS)


def test_a_small_shift_moves_no_range() -> None:
    small, large = taught(200, 2.0, 180.0), taught(200, 5.0, 180.0)
    for marker in MARKERS:
        given = CONFIG.colour(marker)
        assert small.range(marker).hue_low == given.hue_low
        assert large.range(marker).hue_low == (given.hue_low + 5) % 180


def read(name: str) -> np.ndarray:
    picture = cv2.imread(str(DATA / name))
    assert picture is not None
    return picture


def test_every_tag_of_a_photographed_sheet_is_read_where_the_sheet_has_it() -> None:
    """The middles follow from those of the sheet by one homography, up to lens and paper: 640 x 480 pixels."""
    tags = {t.number: t.corners for t in TagDetector("6X6_250").find(read("aruco_sheet.jpg"), 20.0)}
    assert set(tags) == set(SHEET)
    printed = np.array([SHEET[number] for number in tags])
    seen = np.array([corners.mean(axis=0) for corners in tags.values()])
    H, _ = cv2.findHomography(printed, seen)
    expected = cv2.perspectiveTransform(printed[:, None], H)[:, 0]
    assert np.hypot(*(expected - seen).T).max() < 1.0
    assert {len(corners) for corners in tags.values()} == {4}


def test_a_photograph_without_this_dictionary_has_no_tag_of_it() -> None:
    assert TagDetector("APRILTAG_36h11").find(read("aruco_sheet.jpg"), 20.0) == []
    assert TagDetector("6X6_250").find(read("smarties.png"), 20.0) == []


@pytest.mark.parametrize(
    ("colour", "middles"),
    [
        (ColourRange(100, 120, 90, 60), [(377, 81), (347, 238), (294, 320)]),
        (ColourRange(46, 76, 90, 70), [(387, 170), (269, 117)]),
    ],
    ids=["blue", "green"],
)
def test_photographed_coloured_discs_are_found_whole(
    colour: ColourRange, middles: list[tuple[int, int]]
) -> None:
    picture = read("smarties.png")
    hsv = hsv_of(picture, (0, 0, picture.shape[1], picture.shape[0]))
    blobs = find_blobs(hsv, colour, (1500.0, 3000.0))
    found = sorted((blob.u, blob.v) for blob in blobs)
    np.testing.assert_allclose(found, sorted(middles), atol=2.0)
    assert {round(blob.area / 2200.0, 0) for blob in blobs} == {1.0}


def test_a_real_camera_s_lens_is_found_from_its_chessboards() -> None:
    pictures = [read(f"chessboard_{i}.jpg") for i in (1, 2, 3, 5, 8)]
    fit = lens_from_chessboards(pictures, (9, 6), 0.025)
    assert len(fit.used) == 5
    assert fit.rms < 0.3
    assert fit.lens.K[0, 0] == pytest.approx(fit.lens.K[1, 1], rel=0.01)  # square pixels
    assert fit.lens.K[:2, 2] == pytest.approx((320, 240), abs=30)
    assert fit.lens.D[0] < -0.2  # a barrel, as the straight edges in the pictures show


def spot(x: float, y: float, std: float = 1e-4) -> Spot:
    return Spot(np.array([x, y]), np.eye(2) * std**2)


def seen(pose: tuple[float, float, float], layout: MarkerLayout) -> tuple[Spot, Spot]:
    x, y, psi = pose
    R = np.array([[cos(psi), -sin(psi)], [sin(psi), cos(psi)]])
    return tuple(spot(*(np.array([x, y]) + R @ np.array(m))) for m in (layout.front, layout.rear))


@pytest.mark.parametrize("layout", [LAYOUT, ODD])
@pytest.mark.parametrize("heading", [-3.1, -pi / 2, 0.0, 1.0, 3.1])
def test_pose_is_recovered(layout: MarkerLayout, heading: float) -> None:
    head = head_pose(*seen((0.3, -0.8, heading), layout), layout)
    assert (head.x, head.y) == pytest.approx((0.3, -0.8))
    assert wrap(head.heading - heading) == pytest.approx(0.0)


@pytest.mark.parametrize("layout", [LAYOUT, ODD])
def test_covariance_is_that_of_the_markers_carried_through_the_pose(layout: MarkerLayout) -> None:
    """J S J^T with J from central differences of the pose."""
    front, rear = seen((0.3, -0.8, 0.7), layout)
    a, b = np.array([[2.0, 0.5], [0.5, 1.0]]) * 1e-7, np.array([[1.0, -0.3], [-0.3, 3.0]]) * 1e-7

    def pose(shift: np.ndarray) -> np.ndarray:
        head = head_pose(
            Spot(front.position + shift[:2], a), Spot(rear.position + shift[2:], b), layout
        )
        return np.array([head.x, head.y, head.heading])

    h = 1e-6
    J = np.column_stack([(pose(h * axis) - pose(-h * axis)) / (2 * h) for axis in np.eye(4)])
    S = np.block([[a, np.zeros((2, 2))], [np.zeros((2, 2)), b]])
    stated = head_pose(Spot(front.position, a), Spot(rear.position, b), layout).covariance
    np.testing.assert_allclose(stated, J @ S @ J.T, rtol=1e-6)


def test_spacing_is_the_distance_of_the_markers_however_they_sit() -> None:
    front, rear = seen((0.3, -0.8, 0.7), ODD)
    assert ODD.spacing == pytest.approx(float(np.linalg.norm(front.position - rear.position)))


def test_an_uncertain_marker_pulls_the_head_less() -> None:
    """The markers are seen 2 mm too far apart; the rear one is ten times as uncertain."""
    front, rear = spot(0.046, 0.0, 1e-4), spot(-0.046, 0.0, 1e-3)
    head = head_pose(front, rear, LAYOUT)
    assert head.x == pytest.approx(0.001 - 0.002 / 101, abs=1e-7)


def chain(pose: tuple[float, float, float], relative: list[float]) -> list[Spot]:
    x, y, angle = pose
    place = np.array([x, y]) - 0.075 * np.array([cos(angle), sin(angle)])
    spots = []
    for bend in relative:
        angle += bend
        place = place - 0.0233 * np.array([cos(angle), sin(angle)])
        spots.append(spot(*place))
    return spots


@pytest.mark.parametrize("relative", [[0.0, 0.0, 0.0], [0.4, -0.2, 0.3], [-0.8, -0.3, -0.3]])
def test_tail_angles_are_recovered(relative: list[float]) -> None:
    pose = (0.5, 0.1, 3.0)
    one, two, three = chain(pose, relative)
    red, green = [three, one], [two]  # links 1 and 3 share a colour
    angles = tail_angles(HeadPose(*pose, np.eye(3)), [red, green, red], LAYOUT, 0.008)
    assert angles == pytest.approx(relative)


def test_a_tail_marker_to_the_left_counts_negative() -> None:
    left = [[spot(-0.075 - 0.0233 * cos(0.5), 0.0233 * sin(0.5))]]
    assert tail_angles(HeadPose(0, 0, 0, np.eye(3)), left, LAYOUT, 0.008) == pytest.approx([-0.5])


def test_a_chain_with_a_hole_ends_there() -> None:
    pose = (0.5, 0.1, 1.0)
    one, _, three = chain(pose, [0.1, 0.1, 0.1])
    links = [[one, three], [], [one, three]]
    assert tail_angles(HeadPose(*pose, np.eye(3)), links, LAYOUT, 0.008) == pytest.approx([0.1])


@pytest.mark.parametrize("share", [1.0 - 0.009 / 0.0233, 1.0 + 0.009 / 0.0233])
def test_a_marker_at_the_wrong_distance_is_no_link(share: float) -> None:
    stray = [[spot(-0.075 - share * 0.0233, 0.0)]]
    head = HeadPose(0.0, 0.0, 0.0, np.eye(3))
    assert tail_angles(head, stray, LAYOUT, 0.008) == ()
    assert tail_angles(head, stray, LAYOUT, 0.010) == pytest.approx([0.0])


def test_swapped_head_markers_are_seen_by_the_tail() -> None:
    pose = (0.5, 0.1, 1.0)
    tail = chain(pose, [0.2, 0.1, 0.1])
    assert tail_sides(HeadPose(*pose, np.eye(3)), tail, LAYOUT, 0.08) == (3, 0)
    assert tail_sides(HeadPose(0.5, 0.1, 1.0 - pi, np.eye(3)), tail, LAYOUT, 0.08) == (0, 3)
    assert tail_sides(HeadPose(*pose, np.eye(3)), [], LAYOUT, 0.08) == (0, 0)
