# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When a fish that does not look is stopped."""

import math

import pytest

from fish_control.exciter import heads_for_a_wall, stopping_rudder
from fish_control.line_of_sight import Motion
from fish_control.pool import HALF_LENGTH, HALF_WIDTH, stopping_turn, wall_distance


@pytest.mark.parametrize(
    ("x", "y", "heading", "surge", "sway", "stopped"),
    [
        (HALF_LENGTH - 0.34, 0.0, 0.0, 0.2, 0.0, True),  # 0.14 m from the wall a second later
        (HALF_LENGTH - 0.36, 0.0, 0.0, 0.2, 0.0, False),
        (HALF_LENGTH - 0.34, 0.0, math.pi, 0.2, 0.0, False),  # away from it
        (
            HALF_LENGTH - 0.05,
            0.0,
            math.pi,
            0.05,
            0.0,
            False,
        ),  # put down near the wall, swimming away
        (HALF_LENGTH - 0.34, 0.0, math.pi / 2, 0.0, -0.2, True),  # sideways
        (0.0, HALF_WIDTH - 0.34, 0.0, 0.0, 0.2, True),
        (0.0, HALF_WIDTH - 0.34, 0.0, 0.0, -0.2, False),
        (
            0.0,
            HALF_WIDTH - 0.34,
            math.pi / 6,
            0.3,
            0.0,
            False,
        ),  # 0.15 m of the 0.3 m are towards the wall
        (
            0.0,
            HALF_WIDTH - 0.34,
            math.pi / 6,
            0.3,
            0.2 / math.sqrt(3.0),
            True,
        ),  # and 0.1 m more sideways
        (0.0, 0.0, 0.0, 0.3, 0.0, False),
    ],
)
def test_a_fish_that_heads_for_a_wall_is_seen(x, y, heading, surge, sway, stopped):
    assert (
        heads_for_a_wall(Motion(x, y, heading, surge, sway, 0.0), horizon=1.0, margin=0.15)
        is stopped
    )


def test_the_rudder_goes_to_the_side_with_more_room():
    motion = Motion(1.9, 0.4, 0.3, 0.2, 0.0, 0.0)
    rudder = stopping_rudder(motion, 0.8)
    distances = {side: wall_distance(stopping_turn(1.9, 0.4, 0.3, side)) for side in (-1.0, 1.0)}
    assert rudder == 0.8 * max(distances, key=distances.get)
