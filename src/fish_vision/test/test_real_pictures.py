# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Photographs of real cameras (data/README.md): tags, coloured discs, a chessboard."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from fish_vision.calibrate import lens_from_chessboards
from fish_vision.segmentation import ColourRange, find_blobs, hsv_of
from fish_vision.tags import TagDetector

DATA = Path(__file__).parent / "data"
SHEET = {  # middles of the tags on the printed sheet, in units of its picture's pixels
    23: (1075.6, 544.5),
    40: (1363.5, 1336.5),
    62: (590.3, 947.4),
    98: (1707.5, 1018.6),
    124: (1593.4, 342.4),
    203: (490.5, 305.5),
}


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
