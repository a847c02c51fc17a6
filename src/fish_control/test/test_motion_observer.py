# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The filters' memory between odometry messages."""

import pytest

from fish_control.line_of_sight import Motion, MotionObserver

STILL = Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def observer():
    """Remembers the time it was fed, from stamp 10.0 to 10.5 s."""
    made = MotionObserver(0.0, lambda seconds, _, dt: seconds + dt)
    for k in range(51):
        made.add(10.0 + 0.01 * k, STILL)
    return made


def test_it_adds_up_the_time_between_stamps():
    assert observer().state == pytest.approx(0.5)


@pytest.mark.parametrize("stamp", [10.5, 10.49, 10.45])
def test_a_repeated_stamp_and_one_a_little_out_of_order_are_ignored(stamp):
    made = observer()
    made.add(stamp, STILL)
    assert made.state == pytest.approx(0.5)
    made.add(10.51, STILL)
    assert made.state == pytest.approx(0.51)  # nothing counts twice


@pytest.mark.parametrize("stamp", [10.7, 9.0])
def test_a_gap_and_a_clock_set_back_start_anew(stamp):
    made = observer()
    made.add(stamp, STILL)
    assert made.state == 0.0
    made.add(stamp + 0.01, STILL)
    assert made.state == pytest.approx(0.01)
