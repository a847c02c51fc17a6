# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Paths that would touch a wall."""

import numpy as np
import pytest

from fish_control.paths import make_path
from fish_control.pool import PathOutsidePoolError, check_inside_pool, stopping_side, stopping_turn


def test_a_path_inside_passes_up_to_its_margin():
    path = make_path("circle", radius=0.9)
    check_inside_pool(path, 0.16)
    with pytest.raises(PathOutsidePoolError):
        check_inside_pool(path, 0.17)


def test_the_refusal_says_where_how_far_and_what_to_do():
    path = make_path("straight", length=4.2)
    with pytest.raises(PathOutsidePoolError) as refusal:
        check_inside_pool(path, 0.1)
    assert "straight" in str(refusal.value)
    assert "(-2.10, " in str(refusal.value)
    assert "|x| <= 2.035" in str(refusal.value)
    assert "make it smaller" in str(refusal.value)


def test_a_path_that_ends_towards_a_wall_needs_room_to_stop():
    """It ends at (-0.508, 0.855) m on course 2 rad; the turn's highest point is (1 + cos 2) 0.27 m above."""
    to_the_wall = {"length": 1.0, "course": 2.0, "x": -0.3, "y": 0.4}
    with pytest.raises(
        PathOutsidePoolError, match=r"ends so that .* fish comes to \(-0.7[3-7], 1.01\)"
    ):
        check_inside_pool(make_path("straight", **to_the_wall), 0.1)
    check_inside_pool(make_path("straight", **to_the_wall, end="loop"), 0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_path_that_ends_beside_a_wall_is_passed_as_the_fish_stops_on_the_other_side(side):
    check_inside_pool(
        make_path("straight", length=1.0, course=np.pi / 2, x=side * 1.8, y=-0.2), 0.3
    )


def test_a_fish_stops_to_the_side_with_more_room():
    assert stopping_side(2.0, 0.0, 1.57) == 1.0  # towards +y beside the wall at +x: left
    assert stopping_side(-2.0, 0.0, 1.57) == -1.0
    assert (
        stopping_side(-0.7, -0.7, -1.97) == -1.0
    )  # down and back: the right turn leaves the wall at -y sooner


def test_the_stopping_turn_is_a_circle():
    turn = stopping_turn(0.1, 0.2, 0.0, 1.0)
    np.testing.assert_allclose(np.hypot(turn[:, 0] - 0.1, turn[:, 1] - 0.2 - 0.27), 0.27)
    np.testing.assert_allclose(turn[0], [0.1, 0.2])
    assert turn[1, 0] > 0.1
