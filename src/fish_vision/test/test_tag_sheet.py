# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sheet of tags: OpenCV finds every tag on the print, with its number and in true millimetres."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from fish_vision.calibration import CalibrationError
from fish_vision.tags import MARGIN, PAGES, RULER, TagDetector, tag_sheet
from fish_vision.verbs import calibrate

SCALE = 10  # pixels a mm
SVG = "{http://www.w3.org/2000/svg}"
SQUARE = re.compile(r"M([\d.]+) ([\d.]+)h([\d.]+)v([\d.]+)h-[\d.]+z")


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
