# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Geometry of sampled paths against closed forms."""

import numpy as np
import pytest

from fish_control.paths import make_path
from fish_control.reference_path import PathError, ReferencePath


def test_circle_has_length_heading_and_curvature_of_a_circle():
    path = make_path("circle", radius=0.6, x=0.3, y=-0.1)
    s = np.linspace(0.0, path.length, 50)
    angle = -0.5 * np.pi + s / 0.6
    assert path.length == pytest.approx(2.0 * np.pi * 0.6, abs=1e-6)
    np.testing.assert_allclose(
        path.point(s),
        np.column_stack([0.3 + 0.6 * np.cos(angle), -0.1 + 0.6 * np.sin(angle)]),
        atol=2e-6,
    )
    np.testing.assert_allclose(
        path.tangent(s), np.column_stack([-np.sin(angle), np.cos(angle)]), atol=1e-4
    )
    np.testing.assert_allclose(path.curvature_at(s), 1.0 / 0.6, rtol=1e-3)


def test_clockwise_circle_curves_to_the_right():
    assert make_path("circle", radius=0.5, direction=-1).curvature_at(1.0) == pytest.approx(
        -2.0, rel=1e-3
    )


def test_closed_path_is_periodic():
    path = make_path("figure_eight")
    np.testing.assert_allclose(path.point(0.7), path.point(0.7 + 2.0 * path.length), atol=1e-9)


def test_sinusoid_has_its_curvature_at_the_crest():
    path = make_path("sinusoid", amplitude=0.5, length=3.0, cycles=1.0)
    crest = np.argmax(path.points[:, 1])
    assert path.curvature[crest] == pytest.approx(-0.5 * (2.0 * np.pi / 3.0) ** 2, rel=1e-2)


def test_open_path_goes_straight_on_beyond_its_ends():
    path = make_path("straight", length=2.0, course=0.0)
    np.testing.assert_allclose(path.point([-0.5, 2.5]), [[-1.5, 0.0], [1.5, 0.0]], atol=1e-12)
    assert path.curvature_at(2.5) == 0.0


def test_point_and_tangent_agree():
    path = make_path("R")
    s = np.linspace(0.01, path.length - 0.01, 300)
    step = 1e-3
    slope = (path.point(s + step) - path.point(s - step)) / (2.0 * step)
    np.testing.assert_allclose(slope, path.tangent(s), atol=5e-3)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ([[0.0, 0.0]], "2 are needed"),
        ([[0.0, 0.0], [0.0, 0.0]], "2 are needed"),
        ([[0.0, 0.0], [np.nan, 0.0]], "not finite"),
        ([0.0, 1.0], "expected (M, 2)"),
    ],
)
def test_unusable_points_are_refused(points, said):
    with pytest.raises(PathError, match=said.replace("(", r"\(").replace(")", r"\)")):
        ReferencePath.from_points(points, name="drawn")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("points", "closed", "length"),
    [
        ([[0.0, 0.0], [0.0, 201.0]], False, "201"),
        ([[0.0, 0.0], [90.0, 0.0], [90.0, 20.0]], True, "202.195"),
        ([[0.0, 0.0], [1e13, 0.0]], False, "1e\\+13"),
        ([[0.0, 0.0], [1e308, 0.0], [-1e308, 0.0]], False, "inf"),
        ([[0.0, 0.0], [1e308, 0.0], [-1e308, 0.0]], True, "inf"),
    ],
)
def test_a_path_that_is_too_long_is_refused_before_memory_is_asked_for(points, closed, length):
    with pytest.raises(PathError, match=f"'drawn': {length} m long, expected at most 200 m"):
        ReferencePath.from_points(points, name="drawn", closed=closed)


def test_unknown_end_lists_the_known():
    with pytest.raises(PathError, match="known: stop, loop"):
        ReferencePath.from_points([[0, 0], [1, 0]], name="drawn", end="bounce")
