# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Points of CSV files: columns by name, dialects, and what is refused."""

import csv
import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fish_control.paths.points_file import read_points
from fish_control.reference_path import PathError

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
