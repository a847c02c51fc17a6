# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where head, tail and markers of the drawn fish are."""

from math import cos, pi, sin

import numpy as np

from fish_sim.camera import FishPose, FishShape
from fish_sim.camera.fish import FRONT, REAR, joints, markers, patches

SHAPE = FishShape()


def test_straight_tail_lies_behind_the_head() -> None:
    hinges, theta = joints(FishPose(1.0, 0.5, pi / 2, (0.0, 0.0, 0.0)), SHAPE)
    np.testing.assert_allclose(hinges[:, 0], 1.0, atol=1e-12)
    np.testing.assert_allclose(hinges[:, 1], 0.5 - 0.075 - np.arange(4) * 0.07 / 3, atol=1e-12)
    np.testing.assert_allclose(theta, pi / 2)


def test_negative_angle_bends_the_tail_to_the_left() -> None:
    hinges, _ = joints(FishPose(0.0, 0.0, 0.0, (-0.4, 0.0, 0.0)), SHAPE)
    assert np.all(np.diff(hinges[:, 1]) > 0)  # left of a fish that looks along x is +y
    np.testing.assert_allclose(
        hinges[1], [-0.075 - 0.07 / 3 * cos(0.4), 0.07 / 3 * sin(0.4)], atol=1e-12
    )


def test_missing_tail_angles_count_as_straight() -> None:
    np.testing.assert_allclose(
        joints(FishPose(0.1, 0.2, 0.3), SHAPE)[0],
        joints(FishPose(0.1, 0.2, 0.3, (0.0,) * 5), SHAPE)[0],
    )


def test_head_markers_have_their_centre_of_mass_between_them() -> None:
    (front, _, front_colour), (rear, _, rear_colour), *tail = markers(
        FishPose(0.4, -0.3, 2.0), SHAPE
    )
    np.testing.assert_allclose((front + rear) / 2, [0.4, -0.3], atol=1e-12)
    np.testing.assert_allclose(front - rear, 0.09 * np.array([cos(2.0), sin(2.0)]), atol=1e-12)
    assert (front_colour, rear_colour, len(tail)) == (FRONT, REAR, 3)


def test_everything_drawn_is_within_the_length_of_the_fish() -> None:
    points = np.vstack([patch.outline for patch in patches(FishPose(0.0, 0.0, 0.0), SHAPE)])
    assert -0.075 - 0.07 - 0.03 - 1e-9 <= points[:, 0].min()
    assert points[:, 0].max() <= 0.075 + 1e-9
