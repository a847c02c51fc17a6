# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reasons to end a run, on plain numbers."""

import pytest

from fish_bringup.run_limits import (
    EDGE,
    LONGEST_AT_EDGE,
    LONGEST_WITHOUT_CAMERA,
    RunWatch,
    Seen,
)
from fish_control.pool import HALF_LENGTH, HALF_WIDTH

FRAME = 1.0 / 30.0  # s


def reasons(watch, poses, begin=100.0):
    """What is said at each of the camera's poses (x, y)."""
    times = [begin + FRAME * k for k in range(len(poses))]
    return [watch.reason_to_end(t, Seen(t, x, y)) for t, (x, y) in zip(times, poses, strict=True)]


@pytest.mark.parametrize(
    "place",
    [
        (HALF_LENGTH, 0.0),
        (-HALF_LENGTH + 0.5 * EDGE, 0.3),
        (0.0, HALF_WIDTH),
        (0.0, -1.44),
        (0.5, 1.44),
    ],
)
def test_a_fish_at_a_wall_or_beyond_ends_the_run_after_a_second(place):
    said = reasons(RunWatch(100.0), [(0.0, 0.0)] * 10 + [place] * 60)
    first = next(k for k, reason in enumerate(said) if reason)
    assert (first - 10) * FRAME == pytest.approx(LONGEST_AT_EDGE, abs=1.5 * FRAME)
    assert said[first].startswith("the fish left the pool")
    assert f"({place[0]:.2f}, {place[1]:.2f}) m" in said[first]


def test_a_fish_that_comes_near_a_wall_or_is_misplaced_now_and_then_swims_on():
    near = (HALF_LENGTH - 2.0 * EDGE, 0.0)
    beyond = (HALF_LENGTH + 0.5, 0.0)
    assert reasons(RunWatch(100.0), [near] * 200 + ([beyond] * 20 + [near]) * 10) == [None] * 410


def test_a_pose_that_is_no_number_is_no_place_outside():
    nowhere = (float("nan"), 0.0)
    assert reasons(RunWatch(100.0), [(0.0, 0.0)] + [nowhere] * 200) == [None] * 201


def test_fusion_that_goes_on_without_the_camera_ends_the_run():
    watch = RunWatch(0.0)
    last = Seen(5.0, 0.0, 0.0)
    assert watch.reason_to_end(5.0 + LONGEST_WITHOUT_CAMERA, last) is None
    assert "no camera/pose for 30 s" in watch.reason_to_end(5.1 + LONGEST_WITHOUT_CAMERA, last)


def test_a_camera_that_never_spoke_is_waited_for_from_the_begin_on():
    watch = RunWatch(7.0)
    assert watch.reason_to_end(7.0 + LONGEST_WITHOUT_CAMERA, None) is None
    assert "no camera/pose" in watch.reason_to_end(7.1 + LONGEST_WITHOUT_CAMERA, None)


def test_a_pose_of_long_before_the_begin_counts_as_none():
    """An estimate that came late: the camera has its whole time from the begin on."""
    watch = RunWatch(100.0)
    assert watch.reason_to_end(110.0, Seen(60.0, 0.0, 0.0)) is None


def test_no_time_is_left_where_the_robots_clock_stands():
    """A slow computer asks often, and the robot's time does not pass."""
    watch = RunWatch(0.0, limit=10.0)
    assert {watch.reason_to_end(3.0, Seen(2.9, HALF_LENGTH, 0.0)) for _ in range(10_000)} == {None}


def test_the_limit_is_said():
    watch = RunWatch(50.0, limit=20.0)
    assert watch.reason_to_end(70.0, Seen(70.0, 0.0, 0.0)) is None
    assert watch.reason_to_end(70.1, Seen(70.0, 0.0, 0.0)) == "the run is not over after 20 s"


def test_a_pose_that_comes_out_of_order_is_left_out():
    watch = RunWatch(0.0)
    for stamp, x in ((1.0, HALF_LENGTH), (0.5, 0.0), (2.1, HALF_LENGTH)):
        said = watch.reason_to_end(stamp, Seen(stamp, x, 0.0))
    assert said is not None
    assert "left the pool" in said
