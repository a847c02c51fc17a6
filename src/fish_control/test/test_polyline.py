# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drawings as paths."""

import gzip

import numpy as np
import pytest

from fish_control.paths import make_path
from fish_control.reference_path import PathError


def test_csv_points_are_metres_where_they_are(tmp_path):
    file = tmp_path / "l.csv"
    file.write_text("# my path\n0,0\n1,0\n\n1,0.5\n")
    path = make_path("polyline", file=str(file), radius=0.0)
    assert path.length == pytest.approx(1.5, abs=1e-9)
    np.testing.assert_allclose(path.point([0.0, 1.0, 1.5]), [[0, 0], [1, 0], [1, 0.5]], atol=5e-3)


def test_a_file_name_is_a_path(tmp_path):
    file = tmp_path / "l.csv"
    file.write_text("0,0\n1,0\n")
    assert make_path(str(file)).length == pytest.approx(1.0)


def test_csv_that_returns_to_its_start_is_closed(tmp_path):
    file = tmp_path / "square.csv"
    file.write_text("0,0\n1,0\n1,1\n0,1\n0,0\n")
    path = make_path("polyline", file=str(file), radius=0.0)
    assert path.closed
    assert path.length == pytest.approx(4.0, abs=1e-6)


def test_bad_line_is_named(tmp_path):
    file = tmp_path / "bad.csv"
    file.write_text("0,0\n1,zero\n")
    with pytest.raises(PathError, match="line 2 is '1,zero'"):
        make_path("polyline", file=str(file))


@pytest.mark.parametrize("content", ["Länge,Höhe\n0,0\n1,0\n".encode("latin-1"), b"0" * 200_000])
def test_a_csv_that_is_no_text_with_lines_is_refused(tmp_path, content):
    file = tmp_path / "bad.csv"
    file.write_bytes(content)
    with pytest.raises(
        PathError, match=r"bad.csv' is not UTF-8 text with lines x,y|line 1 is '0000"
    ):
        make_path(str(file))


def test_a_byte_order_mark_does_not_cost_the_first_point(tmp_path):
    file = tmp_path / "l.csv"
    file.write_text("0,0\n1,0\n3,0\n", encoding="utf-8-sig")
    assert make_path(str(file)).length == pytest.approx(3.0)


def test_corners_are_rounded_with_the_radius(tmp_path):
    file = tmp_path / "corner.csv"
    file.write_text("0,0\n1,0\n1,1\n")
    path = make_path("polyline", file=str(file), radius=0.3)
    assert path.length == pytest.approx(2.0 - 2.0 * 0.3 + 0.5 * np.pi * 0.3, abs=1e-4)
    assert path.curvature.max() == pytest.approx(1.0 / 0.3, rel=0.02)


DRAWN = '<svg xmlns="http://www.w3.org/2000/svg" width="300mm" height="200mm" viewBox="0 0 300 200">{}</svg>'


@pytest.fixture
def drawing(tmp_path):
    file = tmp_path / "drawing.svg"
    file.write_text(DRAWN.format('<path id="a" d="M 10,20 H 110 V 70"/>'))
    return str(file)


def test_a_drawing_has_its_true_size_and_its_middle_where_asked(drawing):
    path = make_path(drawing, radius=0.0, x=0.5, y=-0.25)
    assert path.length == pytest.approx(0.15)
    np.testing.assert_allclose(path.points[0], [0.45, -0.225], atol=1e-9)
    np.testing.assert_allclose(path.points[-1], [0.55, -0.275], atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "length"), [({"scale": 10.0}, 1.5), ({"width": 1.4}, 2.1), ({"size": 1.0}, 1.5)]
)
def test_a_drawing_is_scaled_only_when_asked(drawing, arguments, length):
    assert make_path(drawing, radius=0.0, **arguments).length == pytest.approx(length)


def test_the_pages_right_is_the_pools_x_and_its_top_the_pools_left(tmp_path):
    file = tmp_path / "turn.svg"
    file.write_text(DRAWN.format('<path d="M 0,100 H 100 V 0"/>'))  # to the right, then up the page
    path = make_path(str(file), radius=0.0)
    np.testing.assert_allclose(path.tangent([0.01, 0.19]), [[1, 0], [0, 1]], atol=1e-6)
    assert path.curvature.max() > 1.0 > -path.curvature.min()  # a turn to the left, as on the page


def test_a_file_of_points_is_scaled_about_the_pools_centre(tmp_path):
    file = tmp_path / "l.csv"
    file.write_text("100,200\n300,200\n")
    np.testing.assert_allclose(make_path(str(file), scale=0.001).points[0], [0.1, 0.2], atol=1e-9)
    np.testing.assert_allclose(make_path(str(file), width=1.0).points[0], [-0.5, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"scale": 2.0, "width": 1.0}, "scale and width are given, expected one"),
        ({"scale": 0.0}, "scale is 0.0, expected a positive"),
        ({"radius": -0.1}, "radius is -0.1, expected a number from 0"),
        ({"id": "b"}, "no visible part with id 'b'; visible: path 'a'"),
        ({"scale": "big"}, "wrong type"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(drawing, arguments, said):
    with pytest.raises(PathError, match=said):
        make_path(drawing, **arguments)


def test_a_drawing_without_a_size_needs_one(tmp_path):
    file = tmp_path / "web.svg"
    file.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M0 0H9V3"/></svg>'
    )
    with pytest.raises(PathError, match=r"states no size .* width: 1\.4"):
        make_path(str(file))
    assert make_path(str(file), width=0.9, radius=0.0).length == pytest.approx(1.2)


def test_a_file_of_points_has_no_ids_and_a_vertical_line_no_width(tmp_path):
    file = tmp_path / "l.csv"
    file.write_text("0,0\n0,1\n")
    with pytest.raises(PathError, match=r"a \.csv file has no parts"):
        make_path(str(file), id="a")
    with pytest.raises(PathError, match="no width"):
        make_path(str(file), width=1.0)


@pytest.mark.parametrize("name", ["a.csv", "a.svg"])
@pytest.mark.parametrize(
    ("content", "said"),
    [
        (gzip.compress(b"x,y"), "compressed by gzip"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:aa\nsize 9\n", "git lfs pull"),
    ],
)
def test_a_packed_file_is_named(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(PathError, match=said):
        make_path(str(tmp_path / name))
