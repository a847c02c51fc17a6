# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fillets and easing."""

import numpy as np
import pytest

from fish_control.paths.rounded import ease, round_corners


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
