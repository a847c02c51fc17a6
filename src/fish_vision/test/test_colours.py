# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Ranges that follow the light."""

import pytest
from pool_picture import CONFIG

from fish_vision.spots import MARKERS, Colours, middle


def taught(pictures: int, shift: float, value: float) -> Colours:
    """Ranges after pictures in which every marker has its hue moved and this value."""
    colours = Colours(CONFIG)
    for _ in range(pictures):
        for marker in MARKERS:
            colours.learn(marker, (middle(CONFIG.colour(marker)) + shift) % 180, value)
    return colours


def test_the_first_pictures_teach_more_than_later_ones() -> None:
    """A marker at the edge of its range is seen now and then: a few sights must do."""
    few, many = taught(5, 10.0, 200.0), taught(200, 10.0, 200.0)
    assert all(7.0 < few.shifts[m] < 10.0 for m in MARKERS)
    assert all(many.shifts[m] == pytest.approx(10.0, abs=0.1) for m in MARKERS)
    assert not few.settled
    assert many.settled


def test_a_range_begins_at_half_the_value_of_its_marker_in_bright_and_dark_light() -> None:
    """A dark hull of the marker's hue is then no part of the marker."""
    for value, least in ((255.0, 128), (120.0, 60), (60.0, 40)):
        colours = taught(200, 0.0, value)
        assert all(abs(colours.range(m).value_min - least) <= 1 for m in MARKERS)


def test_a_small_shift_moves_no_range() -> None:
    small, large = taught(200, 2.0, 180.0), taught(200, 5.0, 180.0)
    for marker in MARKERS:
        given = CONFIG.colour(marker)
        assert small.range(marker).hue_low == given.hue_low
        assert large.range(marker).hue_low == (given.hue_low + 5) % 180
