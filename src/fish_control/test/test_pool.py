"""Paths that would touch a wall."""

import pytest

from fish_control.paths import make_path
from fish_control.pool import PathOutsidePoolError, check_inside_pool


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
