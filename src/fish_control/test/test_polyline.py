"""Drawings as paths."""

import numpy as np
import pytest

from fish_control.paths import make_path
from fish_control.paths.svg import read_svg
from fish_control.reference_path import PathError


def svg(tmp_path, body):
    file = tmp_path / "drawing.svg"
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{body}</svg>')
    return file


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
    with pytest.raises(PathError, match=r"bad.csv' is not UTF-8 text with lines x,y"):
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


def test_svg_y_points_down_and_size_is_in_metres(tmp_path):
    file = svg(tmp_path, '<polyline points="0,0 10,0 10,20"/>')
    path = make_path("polyline", file=str(file), size=1.0, radius=0.0)
    np.testing.assert_allclose(path.points[0], [-0.25, 0.5], atol=1e-9)
    np.testing.assert_allclose(path.points[-1], [0.25, -0.5], atol=1e-9)


def test_svg_commands_absolute_and_relative_draw_the_same(tmp_path):
    absolute, _ = read_svg(
        svg(tmp_path, '<path d="M1 2 L4 2 H6 V5 C7 6 8 6 9 5 S11 4 12 5 Q13 7 14 5 T16 5"/>')
    )
    relative, _ = read_svg(
        svg(tmp_path, '<path d="m1,2 3,0 h2 v3 c1 1 2 1 3 0 s2-1 3 0 q1 2 2 0 t2 0"/>')
    )
    np.testing.assert_allclose(absolute, relative, atol=1e-12)


def test_svg_curve_is_the_bezier_polynomial(tmp_path):
    points, _ = read_svg(svg(tmp_path, '<path d="M0 0 C0 3 3 3 3 0"/>'))
    t = np.linspace(0.0, 1.0, 65)
    y = 3.0 * t * (1.0 - t) ** 2 * 3.0 + 3.0 * t**2 * (1.0 - t) * 3.0
    np.testing.assert_allclose(points[:, 1], -y, atol=1e-12)


def test_svg_z_and_polygon_close_the_path(tmp_path):
    assert len(read_svg(svg(tmp_path, '<path d="M0 0 L1 0 L1 1 z z"/>'))[0]) == 3
    assert read_svg(svg(tmp_path, '<path d="M0 0 L1 0 L1 1 z"/>'))[1]
    assert read_svg(svg(tmp_path, '<polygon points="0,0 1,0 1,1"/>'))[1]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ('<path d="M0 0 A1 1 0 0 0 2 2"/>', "command 'A' is not supported"),
        ('<path d="M0 0 L1"/>', "expected 2 numbers"),
        ('<path d="M0 0 L1 1 M2 2 L3 3"/>', "several parts"),
        ('<path d="M0 0 L1 0 L1 1 Z M5 5 L6 6"/>', "several parts"),
        ('<path d="M0 0 L1 0 L1 1 z l2 2"/>', "several parts"),
        ('<path d="M0 0 L1 0 L1 1 Z 5 5"/>', "'Z' is followed by 5, expected no numbers"),
        ('<path d=""/>', "begins with '', expected M"),
        ('<path d="Z"/>', "begins with 'Z', expected M"),
        ('<path d="L1 1 L2 2"/>', "begins with 'L1 1 L2 2', expected M"),
        ('<path d="M0 0 L10% 0"/>', "'%' in the outline, expected commands and numbers"),
        ('<path d="M0 0 L1e999 0"/>', "coordinate 1e999 is not finite"),
        ('<polyline points="0,0 10px,0"/>', "'p' among them, expected pairs of numbers"),
        ('<polyline points="0,0 10,0 3"/>', "points have 5 numbers, expected pairs"),
        ('<polyline points=""/>', "0 points; 2 are needed"),
        ("<circle r='1'/>", "no path"),
    ],
)
def test_svg_that_cannot_be_swum_is_refused(tmp_path, body, said):
    with pytest.raises(PathError, match=said):
        make_path("polyline", file=str(svg(tmp_path, body)))


@pytest.mark.parametrize("content", ["not xml", '<?xml version="1.0" encoding="mine"?><svg/>'])
def test_file_that_is_no_svg_is_refused(tmp_path, content):
    file = tmp_path / "x.svg"
    file.write_text(content)
    with pytest.raises(PathError, match="not an SVG drawing"):
        make_path("polyline", file=str(file))
