# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner: what it wants, how it ends, how it goes on after an interruption."""

import numpy as np
import pytest

from fish_control.line_of_sight import GuidanceConfig, Motion
from fish_control.paths import make_path
from fish_control.planner import Planner, motion_is_finite


def at(path, s, speed=0.2, side=0.0):
    h = float(path.heading_at(s))
    x, y = path.point(s) + side * np.array([-np.sin(h), np.cos(h)])
    return Motion(float(x), float(y), h, speed, 0.0, 0.0)


def follow(planner, start, end, step=0.004):
    for s in np.arange(start, end, step):
        plan = planner.plan(at(planner.path, s))
    return plan


def test_yaw_rate_is_speed_times_curvature():
    planner = Planner(make_path("circle", radius=0.5), 0.2)
    assert planner.plan(at(planner.path, 0.0)).yaw_rate == pytest.approx(0.4, rel=1e-3)


@pytest.mark.parametrize(
    ("compensates", "error"), [(True, 0.0), (False, np.arcsin(0.4 / (2.0 * 0.5)))]
)
def test_the_law_that_is_asked_for_is_followed(compensates, error):
    """The paper's points inside a circle of 0.5 m by the direction of its chord of 0.4 m."""
    guidance = GuidanceConfig(compensate_curvature=compensates)
    planner = Planner(make_path("circle", radius=0.5), 0.2, guidance=guidance)
    assert planner.plan(at(planner.path, 0.0)).errors.heading == pytest.approx(error, abs=2e-3)


def test_speed_is_wanted_until_the_end_and_zero_for_good_after_it():
    planner = Planner(make_path("I"), 0.15)
    length = planner.path.length
    assert follow(planner, 0.0, length - 0.01).speed == 0.15
    assert follow(planner, length - 0.01, length + 0.05).speed == 0.0
    assert planner.finished
    after = planner.plan(at(planner.path, 1.0, speed=0.12))
    assert after.speed == 0.0
    assert after.errors.speed == pytest.approx(-0.12)


@pytest.mark.parametrize(("x", "side"), [(-1.9, -1.0), (1.9, 1.0)])
def test_after_the_end_it_turns_to_the_side_with_more_room_and_stays_with_it(x, side):
    planner = Planner(make_path("straight", length=1.0, course=np.pi / 2, x=x), 0.2)
    follow(planner, 0.0, 1.01)
    for heading in (1.6, 0.0, 3.1, -2.0):
        plan = planner.plan(Motion(x, 0.55, heading, 0.1, 0.0, 0.0))
        assert plan.speed == 0.0
        assert np.sign(plan.yaw_rate) == side


def test_closed_path_goes_on():
    planner = Planner(make_path("O"), 0.2)
    plan = follow(planner, 0.0, 1.5 * planner.path.length)
    assert plan.speed == 0.2
    assert not planner.finished


def test_errors_are_seen_from_the_mean_heading():
    planner, w = Planner(make_path("straight", length=3.0), 0.2), 4.0 * np.pi
    headings = []
    planner.tracker.reset(0.2)
    for k in range(600):
        t = 0.01 * k
        motion = Motion(-1.3 + 0.2 * t, 0.0, 0.2 * np.sin(w * t), 0.2, 0.0, 0.2 * w * np.cos(w * t))
        planner.observe(t, motion)
        plan = planner.plan(motion)
        if t > 3.0:
            headings.append(plan.errors.heading)
    assert np.abs(headings).max() < 0.04


def test_a_gap_in_the_odometry_restarts_the_filters():
    planner = Planner(make_path("straight", length=3.0), 0.2)
    for k in range(100):
        planner.observe(0.01 * k, Motion(0, 0, 0, 0.2, 0.05, 3.0))
    planner.observe(5.0, Motion(0, 0, 0.1, 0.2, 0.0, 0.0))
    planner.tracker.reset(1.5)
    assert planner.plan(Motion(0, 0, 0.1, 0.2, 0, 0)).errors.heading == pytest.approx(
        -0.1, abs=1e-9
    )


def test_start_nearest():
    planner = Planner(make_path("circle", radius=0.6), 0.2)
    planner.start_nearest(0.0, 0.7)
    assert planner.tracker.progress == pytest.approx(np.pi * 0.6, abs=0.01)


def test_resume_takes_the_nearest_point_ahead_of_the_saved_progress():
    planner = Planner(make_path("figure_eight"), 0.2)
    crossing = 0.5 * planner.path.length  # the path is here at 0 as well
    x, y = planner.path.point(crossing + 0.05)
    assert planner.resume(float(x), float(y), crossing - 0.2, 0.6)
    assert planner.tracker.progress == pytest.approx(crossing + 0.05, abs=0.01)


@pytest.mark.parametrize(("name", "progress"), [("straight", 0.0), ("circle", 0.1)])
def test_resume_near_the_end_stops_at_it_or_goes_round(name, progress):
    """Of the way that may have been swum 0.1 m leads to the end and 0.1 m beyond it."""
    planner = Planner(make_path(name), 0.2)
    length = planner.path.length
    x, y = planner.path.point(length + 0.1)
    assert planner.resume(float(x), float(y), length - 0.1, 0.4)
    assert planner.tracker.progress == pytest.approx(length + progress, abs=0.01)


def test_resume_takes_a_robot_that_has_drifted_off_the_path():
    planner = Planner(make_path("straight", length=3.0), 0.2)
    assert planner.resume(-0.5, 0.35, 1.0, 0.4)
    assert planner.tracker.progress == pytest.approx(1.0, abs=0.01)


def test_resume_refuses_a_robot_that_is_elsewhere():
    planner = Planner(make_path("R"), 0.2)
    assert not planner.resume(1.5, 0.9, 1.0, 0.6)
    assert planner.tracker.progress == 0.0


def test_resume_beyond_the_end_is_refused():
    planner = Planner(make_path("I"), 0.2)
    assert not planner.resume(0.0, 0.85, 5.0, 0.6)


@pytest.mark.parametrize("speed", [0.04, 0.51, float("nan"), -0.2])
def test_speed_out_of_range_is_refused(speed):
    with pytest.raises(ValueError, match=r"expected 0.05 to 0.5"):
        Planner(make_path("I"), speed)


def test_finite():
    assert motion_is_finite(Motion(0, 0, 0, 0, 0, 0))
    assert not motion_is_finite(Motion(0, 0, float("nan"), 0, 0, 0))
