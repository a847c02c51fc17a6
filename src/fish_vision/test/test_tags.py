# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Coded tags: the printed sheet and a fish that carries them.

OpenCV finds every tag on the print, with its number and in true millimetres. The fish gives pose and tail, and no pose rather
than a wrong one.
"""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from math import cos, pi, sin

import cv2
import numpy as np
import pytest
from pool_picture import CONFIG, calibration, draw, with_tag

from fish_vision.calibration import Calibration, CalibrationError, Lens
from fish_vision.choice import Reason
from fish_vision.follower import TagTracker, make_follower
from fish_vision.tags import MARGIN, PAGES, RULER, TagDetector, tag_picture, tag_sheet, tags_in
from fish_vision.tracker import Detection, Lost, Tracker
from fish_vision.verbs import calibrate

SCALE = 10  # pixels a mm
SVG = "{http://www.w3.org/2000/svg}"
SQUARE = re.compile(r"M([\d.]+) ([\d.]+)h([\d.]+)v([\d.]+)h-[\d.]+z")

TAGS = replace(CONFIG, marker_kind="tags", tag_size=0.08, tail_links=0)
NAMES = ("4X4_50", "APRILTAG_36h11")
POND = draw([])
POSES = [(0.5, 0.2, 1.0), (-1.2031, 0.6017, -2.6), (0.0, 0.0, pi - 0.01), (1.5, -0.8, 0.02)]


def printed(sheet: str) -> np.ndarray:
    """What a printer leaves of the dark cells, grey."""
    root = ElementTree.fromstring(sheet)
    width, height = (float(root.get(name).removesuffix("mm")) for name in ("width", "height"))
    assert root.get("viewBox") == f"0 0 {width:g} {height:g}"  # a unit is a millimetre
    image = np.full((round(height * SCALE), round(width * SCALE)), 255, np.uint8)
    for path in root.iter(f"{SVG}path"):
        if path.get("fill") != "black":
            continue
        for square in SQUARE.findall(path.get("d")):
            x, y, w, h = (float(value) * SCALE for value in square)
            image[round(y) : round(y + h), round(x) : round(x + w)] = 0
    return image


@pytest.mark.parametrize(
    ("dictionary", "numbers", "side", "page"),
    [
        ("4X4_50", [0, 1, 2, 49], 50.0, "A4"),
        ("APRILTAG_36h11", [7], 120.0, "letter"),
        ("5X5_100", list(range(20)), 30.0, "A4"),
    ],
)
def test_every_tag_is_found_with_its_number_and_side(dictionary, numbers, side, page):
    image = printed(tag_sheet(dictionary, numbers, side, PAGES[page]))
    found = TagDetector(dictionary).find(image, side * SCALE)
    assert sorted(tag.number for tag in found) == sorted(numbers)
    for tag in found:
        sides = np.linalg.norm(tag.corners - np.roll(tag.corners, 1, axis=0), axis=1)
        assert sides == pytest.approx([side * SCALE] * 4, abs=2.0)  # pixels of 0.1 mm


def test_the_ruler_is_as_long_as_it_says():
    sheet = tag_sheet("4X4_50", [0], 50.0, PAGES["A4"])
    assert f"{RULER:g} mm; print at 100 %" in sheet
    assert f"M{MARGIN} {297.0 - MARGIN}h{RULER}M" in sheet


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["50"], "tag 50: 4X4_50 has the numbers 0 to 49"),
        (["-1"], "tag -1"),
        (["0", "--side", "2"], "side 2 mm: expected 5 to 180"),
        (["0", "--side", "nan"], "side nan mm"),
        ([*map(str, range(50))], "50 tags of 50 mm: "),
        (["0", "--dictionary", "9X9"], "no dictionary '9X9'"),
    ],
)
def test_what_cannot_be_printed_is_said(tmp_path, words, said):
    out = tmp_path / "tags.svg"
    args = calibrate.arguments().parse_args(["tags", *words, "--out", str(out)])
    with pytest.raises(CalibrationError, match=re.escape(said)):
        args.calibrate(args)
    assert not out.exists()


def test_a_sheet_is_written_and_none_is_overwritten(tmp_path, capsys):
    out = tmp_path / "tags.svg"
    args = calibrate.arguments().parse_args(["tags", "3", "4", "--out", str(out)])
    args.calibrate(args)
    assert "2 tags of 50 mm" in capsys.readouterr().out
    assert out.read_text() == tag_sheet("4X4_50", [3, 4], 50.0, PAGES["A4"])
    with pytest.raises(CalibrationError, match="exists already"):
        args.calibrate(args)


def picture(name: str, x: float, y: float, heading: float, number: int = 0) -> np.ndarray:
    return with_tag(POND, tag_picture(name, number), x, y, heading, TAGS.tag_size)


def seen(found: Detection | Lost) -> tuple[float, float, float]:
    assert isinstance(found, Detection)
    return found.head.x, found.head.y, found.head.heading


def turned(angle: float, by: float) -> float:
    return (angle - by + pi) % (2 * pi) - pi


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("pose", POSES)
def test_pose_is_the_drawn_one_to_half_a_millimetre_and_half_a_degree(
    name: str, pose: tuple[float, float, float]
) -> None:
    """One pixel is 3.3 mm."""
    tracker = TagTracker(replace(TAGS, tag_dictionary=name), calibration())
    x, y, heading = seen(tracker.track(picture(name, *pose), 0.0))
    assert (x, y) == pytest.approx(pose[:2], abs=5e-4)
    assert turned(heading, pose[2]) == pytest.approx(0.0, abs=np.radians(0.5))


def test_the_covariance_is_that_of_the_errors() -> None:
    """The mean of the squared errors over their variances is 1 for a consistent one; twice too sure gives 4."""
    rng, tracker, ratios = np.random.default_rng(3), TagTracker(TAGS, calibration()), []
    for k in range(40):
        pose = (*rng.uniform([-1.5, -0.8], [1.5, 0.8]), rng.uniform(-pi, pi))
        noisy = picture("4X4_50", *pose) + rng.normal(0.0, 4.0, POND.shape)
        found = tracker.track(np.clip(noisy, 0, 255).astype(np.uint8), 10.0 * k)
        x, y, heading = seen(found)
        error = np.array([x - pose[0], y - pose[1], turned(heading, pose[2])])
        ratios.append(error**2 / np.diag(found.head.covariance))
    assert (np.mean(ratios, axis=0) < 2.0).all()


def test_the_tag_may_sit_anywhere_on_the_head() -> None:
    x, y, heading = 0.3, -0.2, 0.7
    mounted = (0.03, -0.01, 0.5)  # base_link x, y, turn
    place = (
        x + cos(heading) * mounted[0] - sin(heading) * mounted[1],
        y + sin(heading) * mounted[0] + cos(heading) * mounted[1],
    )
    tracker = TagTracker(replace(TAGS, head_tag_pose=mounted), calibration())
    found = seen(tracker.track(picture("4X4_50", *place, heading + mounted[2]), 0.0))
    assert found == pytest.approx((x, y, heading), abs=5e-3)


def test_tail_angles_are_those_between_the_tags() -> None:
    config = replace(TAGS, tail_links=2, link_length=0.1, hinge_offset=0.06, tail_tag_size=0.06)
    scene = picture("4X4_50", 0.2, 0.1, 0.4)
    scene = with_tag(scene, tag_picture("4X4_50", 1), 0.08, 0.05, 0.7, 0.06)
    scene = with_tag(scene, tag_picture("4X4_50", 2), 0.0, -0.03, 0.5, 0.06)
    found = TagTracker(config, calibration()).track(scene, 0.0)
    assert isinstance(found, Detection)
    assert found.tail == pytest.approx((0.3, -0.2), abs=0.02)
    alone = TagTracker(config, calibration()).track(picture("4X4_50", 0.2, 0.1, 0.4), 0.0)
    assert isinstance(alone, Detection)
    assert alone.tail is None


def test_followed_in_the_region_of_interest_after_the_first_picture() -> None:
    tracker = TagTracker(TAGS, calibration())
    found = [tracker.track(picture("4X4_50", 0.01 * k, 0.1, 0.2), k / 30) for k in range(3)]
    assert [f.whole_image for f in found] == [True, False, False]
    left, _, right, _ = found[-1].box
    assert right - left == pytest.approx(2 * TAGS.roi_radius * 300.0, abs=3)


def test_no_pose_rather_than_a_wrong_one() -> None:
    def reason(scene: np.ndarray) -> Reason:
        tracker = TagTracker(replace(TAGS, pool_margin=0.0), calibration())
        found = tracker.track(scene, 0.0)
        assert isinstance(found, Lost)
        return found.reason

    own = tag_picture("4X4_50", 0)
    assert reason(POND) == Reason.NO_TAG
    assert reason(picture("4X4_50", 0.5, 0.2, 1.0, number=7)) == Reason.NO_TAG
    two = with_tag(picture("4X4_50", 0.5, 0.2, 1.0), own, -0.5, 0.2, 1.0, TAGS.tag_size)
    assert reason(two) == Reason.AMBIGUOUS
    assert reason(with_tag(POND, own, 0.5, 0.2, 1.0, 1.1 * TAGS.tag_size)) == Reason.TAG_SIZE
    assert reason(picture("4X4_50", 0.5, 0.2, 1.0)[:, ::-1].copy()) == Reason.NO_TAG  # a mirror
    assert reason(picture("4X4_50", 0.5, 1.1, 1.0)) == Reason.OUTSIDE


def test_a_jump_gives_no_pose_until_the_fish_may_be_anywhere() -> None:
    tracker = TagTracker(TAGS, calibration())
    seen(tracker.track(picture("4X4_50", 0.5, 0.2, 1.0), 0.0))
    elsewhere = picture("4X4_50", -1.0, 0.2, 1.0)
    jump = tracker.track(elsewhere, 0.03)
    assert isinstance(jump, Lost)
    assert jump.reason == Reason.JUMP
    assert seen(tracker.track(elsewhere, 0.03 + 2 * TAGS.reacquire_s))[0] == pytest.approx(
        -1.0, abs=1e-3
    )


def test_a_wrong_focal_length_shows_in_the_tag_s_size() -> None:
    width, height, model = 1280, 720, "plumb_bob"
    k = [945.0, 0.0, 640.0, 0.0, 945.0, 360.0, 0.0, 0.0, 1.0]
    wrong = Calibration(Lens.from_camera_info(width, height, model, k, [0.0] * 5), TAGS.mount())
    found = TagTracker(TAGS, wrong).track(picture("4X4_50", 0.5, 0.2, 1.0), 0.0)
    assert isinstance(found, Lost)
    assert found.reason == Reason.TAG_SIZE
    assert found.spacing == pytest.approx(1 / 1.05 - 1, abs=0.01)


def test_a_hand_over_half_of_the_tag_hides_the_fish() -> None:
    scene = picture("4X4_50", 0.5, 0.2, 0.0)
    u, v = calibration().pool_to_pixel([[0.5, 0.2]])[0].astype(int)
    cv2.rectangle(scene, (u, v - 20), (u + 20, v + 20), (120, 150, 200), cv2.FILLED)
    assert isinstance(TagTracker(TAGS, calibration()).track(scene, 0.0), Lost)


def test_the_detector_gives_corners_clockwise_from_the_upper_left() -> None:
    [tag] = TagDetector("4X4_50").find(picture("4X4_50", 0.5, 0.2, 0.0, number=9), 24.0)
    assert tag.number == 9
    centre = calibration().pool_to_pixel([[0.5, 0.2]])[0]
    corners = centre + 12.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    np.testing.assert_allclose(tag.corners, corners, atol=0.15)
    assert TagDetector("4X4_50").find(POND[:4, :4], 24.0) == []


def test_dictionaries_are_opencv_s() -> None:
    assert tags_in("4X4_50") == 50
    assert tags_in("APRILTAG_36h11") == 587
    with pytest.raises(ValueError, match=r"no dictionary '9X9': expected a name of OpenCV's"):
        tags_in("9X9")


def test_marker_kind_says_which_tracker() -> None:
    assert isinstance(make_follower(TAGS, calibration()), TagTracker)
    assert isinstance(make_follower(CONFIG, calibration()), Tracker)
