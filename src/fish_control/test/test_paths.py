# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Path families, files of points, polylines with rounded corners."""

import csv
import gzip
import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fish_control.paths import PATHS, make_path, read_arguments
from fish_control.paths.letter import STROKES
from fish_control.paths.points_file import read_points
from fish_control.paths.rounded import ease, round_corners
from fish_control.pool import check_inside_pool
from fish_control.reference_path import PathError

TURNING_RADIUS = 0.257  # m, of the nominal fish with the rudder hard over


@pytest.fixture
def drawing(tmp_path):
    file = tmp_path / "drawn.csv"
    file.write_text("x,y\n-0.5,-0.5\n0.5,-0.5\n0.5,0.5\n")
    return file


@pytest.mark.parametrize("name", PATHS)
def test_every_family_gives_an_even_finite_path_inside_the_pool(name, drawing):
    path = make_path(name, **({"file": str(drawing)} if name == "polyline" else {}))
    gaps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    assert np.all(np.isfinite(path.points))
    assert np.all(np.isfinite(path.curvature))
    assert gaps.max() <= path.spacing * (1.0 + 1e-9)
    assert gaps.min() > 0.95 * path.spacing
    assert path.end == ("loop" if path.closed else "stop")
    check_inside_pool(path, 0.1)


@pytest.mark.parametrize("name", PATHS)
def test_every_family_takes_an_end(name, drawing):
    arguments = {"file": str(drawing)} if name == "polyline" else {}
    assert make_path(name, end="stop", **arguments).end == "stop"
    assert make_path(name, end="loop", **arguments).end == "loop"


@pytest.mark.parametrize("key", STROKES)
def test_every_letter_fits_the_pool_and_the_fish(key):
    path = make_path(key)
    check_inside_pool(path, 0.1)
    assert 1.5 < np.ptp(path.points[:, 1]) < 1.71
    assert np.abs(path.curvature).max() < 1.0 / TURNING_RADIUS


@pytest.mark.parametrize("key", "IROS")
def test_letters_of_the_paper_leave_the_rudder_room(key):
    assert np.abs(make_path(key).curvature).max() < 1.0 / 0.33


def test_a_letter_by_its_name_or_its_family():
    np.testing.assert_array_equal(make_path("S").points, make_path("letter", letter="s").points)


def test_a_letter_of_given_height_is_in_the_middle():
    path = make_path("I", height=1.2, y=0.1)
    assert path.points[:, 1].min() == pytest.approx(-0.5)
    assert path.points[:, 1].max() == pytest.approx(0.7)


def test_letters_do_not_share_their_shape():
    shapes = [tuple(np.round(make_path(key).point([0.3, 1.0, 1.6]).ravel(), 2)) for key in STROKES]
    assert len(set(shapes)) == len(STROKES)


def test_figure_eight_crosses_itself_at_its_centre():
    path = make_path("figure_eight")
    np.testing.assert_allclose(
        path.point([0.0, 0.5 * path.length]), [[0.0, 0.0], [0.0, 0.0]], atol=1e-4
    )
    assert np.abs(np.linalg.det(path.tangent([0.0, 0.5 * path.length]))) > 0.5


def test_square_wave_swings_between_its_levels():
    path = make_path("square_wave", amplitude=0.4, radius=0.1)
    assert path.points[:, 1].max() == pytest.approx(0.4, abs=1e-6)
    assert path.points[:, 1].min() == pytest.approx(-0.4, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("circel", {}, "known: circle, figure_eight"),
        ("7", {}, "unknown letter '7'; known: A B"),
        ("circle", {"radios": 1}, "no argument 'radios'; known: radius"),
        ("circle", {"name": "x"}, "no argument 'name'; known: radius"),
        ("circle", {"radius": -1.0}, "radius is -1.0, expected a positive"),
        ("circle", {"radius": "big"}, "wrong type"),
        ("circle", {"direction": 2}, "expected 1"),
        ("square_wave", {"cycles": 1.5}, "whole number"),
        ("polyline", {}, "no file given"),
        ("polyline", {"file": "missing.csv"}, "cannot read 'missing.csv'"),
        ("polyline", {"file": "a.dxf"}, "known: .csv, .svg"),
    ],
)
def test_bad_requests_say_what_is_known(name, arguments, said):
    with pytest.raises(PathError, match=said):
        make_path(name, **arguments)


def test_arguments_are_a_table_of_yaml():
    assert read_arguments("", "path_args") == {}
    assert read_arguments("{radius: 0.6, end: stop}", "path_args") == {"radius": 0.6, "end": "stop"}


@pytest.mark.parametrize("text", ["{", "[1]", "0", "radius", "{1: 2}", "{radius: 2020-13-45}"])
def test_arguments_that_are_no_table_are_refused(text):
    with pytest.raises(PathError) as refusal:
        read_arguments(text, "path_args")
    assert str(refusal.value) == f"path_args is {text!r}, expected YAML such as '{{radius: 0.6}}'"


TWO = [[0.1, 0.2], [1.5, -0.25]]


def read(folder, content):
    file = folder / "points.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_points(file)


@pytest.mark.parametrize(
    "text",
    [
        "0.1,0.2\n1.5,-.25\n",
        "y,x\n0.2,0.1\n-0.25,1.5\n",
        "t,y,z,X\n0,0.2,9,0.1\n1,-0.25,9,1.5\n",
        "x;y\n0,1;0,2\n1,5;-0,25\n",
        "0,1;0,2\n1,5;-0,25\n",
        "x\ty\r\n0.1\t0.2\r\n1.5\t-0.25\r\n",
        '"x","y"\n"0,1","0,2"\n"1,5","-0,25"\n',
        "# y,x\n0.2,0.1\n-0.25,1.5\n",
        "# y x\n0.2,0.1\n-0.25,1.5\n",
        "# columns: y, x\n0.2,0.1\n-0.25,1.5\n",
        "# y (mm) x (mm)\n200,100\n-250,1500\n",
        "# y,x\nx,y\n0.1,0.2\n1.5,-0.25\n",
        "# y, x in mm\nx,y\n0.1,0.2\n1.5,-0.25\n",
        "# x,y\n# x,y\n0.1,0.2\n# y,x\n1.5,-0.25\n",
        "# my x and y, drawn by hand\n0.1,0.2\n1.5,-0.25\n",
        "# my path\n\n0.1, 0.2\n# half\n1.5, -0.25\n",
        "x [mm],y [mm]\n100,200\n1500,-250\n",
        "x_cm;y_cm\n10;20\n150;-25\n",
        "x (m),y (m)\n0.1,0.2,\n1.5,-0.25,\n",
        "sep=;\nx;y\n0,1;0,2\n1,5;-0,25\n",
        "\ufeffx,y\n0.1,0.2\n1.5,-0.25\n",
        "x,y\n0.1,0.2\n1.5,-0.25\n".encode("utf-16"),
    ],
)
def test_one_path_in_many_dialects(tmp_path, text):
    np.testing.assert_allclose(read(tmp_path, text), TWO, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,y\n0,0\n1,5,2,5\n", "line 3 is '1,5,2,5'"),
        ("t,x,y\n0,0,0\n1,1,0,5\n", "line 3 is '1,1,0,5', expected two numbers x,y in 3 columns"),
        ("0.7.00,0.0\n1,0\n", "line 1 is '0.7.00,0.0', expected two numbers"),
        ("east,north\n0,0\n1,0\n", "line 1 is 'east,north', expected .* one column x and one y"),
        ("x,y,x\n0,0,1\n1,0,1\n", "one column x and one y"),
        ("x [mm],y [m]\n0,0\n1,0\n", "x in 'mm' and y in 'm', expected both"),
        ("x [ft],y [ft]\n0,0\n1,0\n", "x in 'ft'"),
        ("0,0,0\n1,0,0\n", "line 1 is '0,0,0', expected two numbers x,y; name the columns"),
        ("0,5,1,5\n", "line 1 is '0,5,1,5'"),
        ("0 0\n1 0\n", "line 1 is '0 0'"),
        ("x,y\n0,0\n1\n", "line 3 is '1', expected two numbers|separates"),
        ("0,0\n1,0,7\n", "line 2 is '1,0,7'"),
        ("0,0\n1;0\n", "';' separates the fields of some lines and not of others"),
        ("0,5;1.5\n1;2\n", "decimal points and decimal commas"),
        ("1.234,5;0,0\n", "line 1 is '1.234,5,0,0'"),
        ("0,0\n1,nan\n", "line 2 has a coordinate that is not finite"),
        ("# y, x in mm\n0,0\n1,0\n", "line 1, the comment 'y,x in mm', seems to name the columns"),
        ("# x,y\n# y,x\n0,0\n1,0\n", "line 2, the comment 'y,x', seems to name the columns"),
        ("0,0\nx,y\n", "line 2 is 'x,y'"),
        ("0,0\n1_0,5\n", "line 2 is '1_0,5'"),
        (b"\xff0,0\n", "not UTF-8 text"),
        ("0,0\n1,0\n".encode("utf-16-le"), "a byte 0"),
    ],
)
def test_what_is_no_point_is_refused_by_its_line(tmp_path, text, said):
    with pytest.raises(PathError, match=said):
        read(tmp_path, text)


def test_a_file_without_rows_has_no_points(tmp_path):
    assert read(tmp_path, "").shape == (0, 2)
    assert read(tmp_path, "x,y\n# nothing\n").shape == (0, 2)


COORDINATE = st.integers(-4000, 4000).map(lambda k: k / 1000.0)


@st.composite
def dialects(draw):
    """Bytes of a CSV file in a random dialect, and its points."""
    points = draw(st.lists(st.tuples(COORDINATE, COORDINATE), min_size=1, max_size=6))
    delimiter = draw(st.sampled_from([",", ";", "\t"]))
    comma = draw(st.booleans())
    extra = draw(
        st.lists(st.sampled_from(["t", "z", "speed", "x2", "yaw"]), unique=True, max_size=2)
    )
    names = draw(st.permutations(["x", "y", *extra]))
    heading = draw(st.sampled_from(["names", "upper", "comment"] + ["none"] * (not extra)))
    if heading == "none":
        names = ["x", "y"]
    out = io.StringIO()
    quoting = (
        csv.QUOTE_ALL
        if comma and delimiter == ","
        else draw(st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_ALL]))
    )
    writer = csv.writer(out, delimiter=delimiter, quoting=quoting, lineterminator="\n")
    if heading != "none":
        out.write("# " * (heading == "comment"))
        writer.writerow([n.upper() if heading == "upper" else n for n in names])
    for x, y in points:
        fields = {"x": f"{x:.3f}", "y": f"{y:.3f}"}
        row = [fields.get(name, "1.000") for name in names]
        writer.writerow([field.replace(".", ",") if comma else field for field in row])
        out.write(draw(st.sampled_from(["", "", "\n", "# noted\n"])))
    newline = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-32"]))
    return out.getvalue().replace("\n", newline).encode(encoding), points


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("dialects")


@settings(max_examples=200, deadline=None, derandomize=True)
@given(case=dialects())
def test_random_dialects_give_their_points(folder, case):
    content, points = case
    np.testing.assert_allclose(read(folder, content), points, atol=1e-9)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(text=st.text(alphabet='xy0123456789.,;\t\n"#- eE+[m]', max_size=60))
def test_any_text_is_finite_points_or_refused(folder, text):
    try:
        points = read(folder, text)
    except PathError:
        return
    assert np.isfinite(points).all()
    assert points.shape[1] == 2


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
def drawn_polyline(tmp_path):
    file = tmp_path / "drawing.svg"
    file.write_text(DRAWN.format('<path id="a" d="M 10,20 H 110 V 70"/>'))
    return str(file)


def test_a_drawing_has_its_true_size_and_its_middle_where_asked(drawn_polyline):
    path = make_path(drawn_polyline, radius=0.0, x=0.5, y=-0.25)
    assert path.length == pytest.approx(0.15)
    np.testing.assert_allclose(path.points[0], [0.45, -0.225], atol=1e-9)
    np.testing.assert_allclose(path.points[-1], [0.55, -0.275], atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "length"), [({"scale": 10.0}, 1.5), ({"width": 1.4}, 2.1), ({"size": 1.0}, 1.5)]
)
def test_a_drawing_is_scaled_only_when_asked(drawn_polyline, arguments, length):
    assert make_path(drawn_polyline, radius=0.0, **arguments).length == pytest.approx(length)


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
def test_arguments_that_do_not_fit_are_refused(drawn_polyline, arguments, said):
    with pytest.raises(PathError, match=said):
        make_path(drawn_polyline, **arguments)


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


def test_fillet_keeps_its_distance_from_the_centre():
    points = round_corners([[0, 0], [2, 0], [2, 2]], 0.5)
    arc = points[1:-1]
    np.testing.assert_allclose(np.hypot(arc[:, 0] - 1.5, arc[:, 1] - 0.5), 0.5, atol=1e-12)


def test_fillets_that_do_not_fit_share_the_side():
    points = round_corners([[0, 0], [0, 1], [0.4, 1], [0.4, 0]], 0.5)
    assert np.abs(points[:, 1]).max() == pytest.approx(1.0)
    middle = points[np.argmax(points[:, 1])]
    assert 0.15 < middle[0] < 0.25  # one half circle of radius 0.2 instead of two of 0.5


def test_ends_stay_and_hairpins_stay_sharp():
    vertices = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0001]])
    points = round_corners(vertices, 0.3)
    np.testing.assert_allclose(points, vertices)


def test_closed_square_becomes_a_stadium_of_known_length():
    points = round_corners([[0, 0], [1, 0], [1, 1], [0, 1]], 0.25, closed=True)
    length = np.linalg.norm(np.diff(np.vstack([points, points[:1]]), axis=0), axis=1).sum()
    assert length == pytest.approx(4 * 0.5 + 2 * np.pi * 0.25, abs=1e-4)


def test_easing_spreads_a_step_of_curvature_over_its_width():
    eased = ease(round_corners([[0, 0], [2, 0], [2, 2]], 0.5), 0.05)
    heading = np.unwrap(np.arctan2(*np.diff(eased, axis=0).T[::-1]))
    curvature = np.diff(heading) / 2e-3
    rise = np.flatnonzero((curvature > 0.2) & (curvature < 1.8))
    assert curvature.max() == pytest.approx(2.0, rel=0.02)
    assert np.abs(np.diff(curvature)).max() < 0.1
    assert 2 * 0.08 < len(rise) * 2e-3 < 2 * 0.2
    np.testing.assert_allclose(eased[[0, -1]], [[0, 0], [2, 2]], atol=1e-9)


def test_easing_a_circle_shrinks_it_by_the_stated_amount():
    angle = np.linspace(0.0, 2.0 * np.pi, 2000)[:-1]
    eased = ease(0.5 * np.column_stack([np.cos(angle), np.sin(angle)]), 0.05, closed=True)
    assert 0.5 - np.hypot(*eased.T).mean() == pytest.approx(0.05**2 / (2 * 0.5), rel=0.02)
