# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""PolicySpec of every path family, and what is special about each."""

import numpy as np
import pytest

from fish_control.paths import PATHS, make_path, read_arguments
from fish_control.paths.letter import STROKES
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
