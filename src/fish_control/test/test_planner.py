# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner: reference path, line of sight, and progress that outlives a restart."""

import json
import os
import threading

import casadi
import numpy as np
import pytest

from fish_control.control_law import ControlLimits, Setpoint, feedforward_throttle
from fish_control.current_observer import LAG, WaterState
from fish_control.line_of_sight import (
    GUIDANCE_NAMES,
    GuidanceConfig,
    GuidanceState,
    Motion,
    PathAhead,
    has_listened,
    heading_error,
    observe,
    slip_lever,
    through_water,
    tracking_errors,
)
from fish_control.path_batch import PathBatch, TrackerConfig
from fish_control.path_tracker import PathTracker
from fish_control.paths import make_path
from fish_control.planner import Planner, ProgressFile, path_digest
from fish_control.reference_path import PathError, ReferencePath
from fish_control.stroke_mean import TURN_LAG, StrokeState


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


CONFIG = GuidanceConfig()
LIMITS = ControlLimits()


def ahead(path, position, s=None):
    tracker = PathTracker(path)
    if s is not None:
        tracker.reset(s)
    at = tracker.update(position)
    return PathAhead(at.x, at.y, at.heading, at.curvature, *at.target, at.chord)


def test_robot_on_a_straight_path_has_no_errors():
    path = make_path("straight", length=2.0, course=0.7)
    motion = Motion(*path.point(0.5), 0.7, 0.2, 0.0, 0.0)
    errors = tracking_errors(StrokeState(), motion, ahead(path, path.point(0.5)), 0.2, CONFIG, np)
    np.testing.assert_allclose(errors, [0.0, 0.0, 0.0, 0.7], atol=1e-9)


@pytest.mark.parametrize("direction", [1, -1])
def test_robot_that_turns_steadily_on_a_circle_has_no_errors(direction):
    """Neither over ground nor in heading; the stroke's filter has forgotten the start of the turn."""
    path, u = make_path("circle", radius=0.5, direction=direction), 0.2
    s, kappa = 1.0, direction / 0.5
    lever = slip_lever(u, CONFIG)
    motion = Motion(
        *path.point(s), float(path.heading_at(s)) + lever * kappa, u, -lever * kappa * u, kappa * u
    )
    state, alpha = GuidanceState(), LIMITS.curvature_gain * kappa
    setpoint = Setpoint(alpha, feedforward_throttle(u, alpha, LIMITS))
    for _ in range(1000):
        state = observe(state, motion, setpoint, 0.01, LIMITS, CONFIG, np)
    assert np.hypot(state.water.current_x, state.water.current_y) < 5e-3  # m/s, left of the start
    errors = tracking_errors(state.stroke, motion, ahead(path, path.point(s), s), u, CONFIG, np)
    assert errors.cross_track == pytest.approx(0.0, abs=1e-5)
    assert errors.heading == pytest.approx(0.0, abs=TURN_LAG * u * abs(kappa) + 2e-3)
    water = through_water(state, errors.course, kappa, u, np)
    assert heading_error(state, motion, water, CONFIG, np) == pytest.approx(0.0, abs=8e-3)


def test_the_papers_law_points_inside_the_circle_by_the_chord():
    path = make_path("circle", radius=0.5)
    motion = Motion(*path.point(1.0), float(path.heading_at(1.0)), 0.2, 0.0, 0.0)
    config = GuidanceConfig(compensate_curvature=False)
    errors = tracking_errors(
        StrokeState(), motion, ahead(path, path.point(1.0), 1.0), 0.2, config, np
    )
    assert errors.heading == pytest.approx(np.arcsin(0.4 / (2 * 0.5)), abs=2e-3)


def test_a_robot_left_of_the_path_should_turn_right():
    path = make_path("straight", length=3.0)
    motion = Motion(0.0, 0.1, 0.0, 0.15, 0.0, 0.0)
    errors = tracking_errors(StrokeState(), motion, ahead(path, [0.0, 0.1], 1.5), 0.2, CONFIG, np)
    assert errors.cross_track == pytest.approx(0.1)
    assert errors.heading == pytest.approx(-np.arcsin(0.1 / 0.4), abs=2e-3)
    assert errors.speed == pytest.approx(0.05)


def test_heading_error_is_the_short_way_round():
    path = make_path("straight", length=3.0)
    motion = Motion(0.0, 0.0, 2.0 * np.pi + 0.1, 0.2, 0.0, 0.0)
    errors = tracking_errors(StrokeState(), motion, ahead(path, [0.0, 0.0], 1.5), 0.2, CONFIG, np)
    assert errors.heading == pytest.approx(-0.1, abs=1e-9)


def learned(current, heading, seconds=5.0, state=None, u=0.2):
    """Memory after swimming straight ahead in a current (2,) [m/s]."""
    state = state or GuidanceState()
    n, t = (
        np.array([-np.sin(heading), np.cos(heading)]),
        np.array([np.cos(heading), np.sin(heading)]),
    )
    motion = Motion(0.0, 0.0, heading, u + t @ current, n @ current, 0.0)
    setpoint = Setpoint(0.0, feedforward_throttle(u, 0.0, LIMITS))
    for _ in range(int(100 * seconds)):
        state = observe(state, motion, setpoint, 0.01, LIMITS, CONFIG, np)
    return state


def test_a_current_is_learned_and_kept_through_a_turn():
    current = np.array([-0.02, 0.03])
    state = learned(current, 0.0)
    assert state.water.current_y == pytest.approx(0.03, abs=1e-3)
    assert (
        abs(state.water.current_x) < 0.025
    )  # ahead or a weak robot? nothing tells before the turn
    state = learned(current, np.pi / 2, state=state)
    assert (state.water.current_x, state.water.current_y) == pytest.approx(tuple(current), abs=3e-3)


def drifted(current, heading, seconds):
    """Memory after a fish that floats was let go in a current (2,) [m/s]: drag takes it along."""
    state, velocity = GuidanceState(), np.zeros(2)
    n, t = (
        np.array([-np.sin(heading), np.cos(heading)]),
        np.array([np.cos(heading), np.sin(heading)]),
    )
    for _ in range(round(100 * seconds)):
        ahead = t @ (current - velocity)
        velocity = velocity + 0.01 * feedforward_throttle(ahead, 0.0, LIMITS) / LAG * t
        velocity = velocity + (n @ (current - velocity)) * n  # sideways the drag is large
        motion = Motion(0.0, 0.0, heading, t @ velocity, n @ velocity, 0.0)
        state = observe(state, motion, Setpoint(0.0, 0.0), 0.01, LIMITS, CONFIG, np)
    return state


@pytest.mark.parametrize("current", [(0.03, 0.0), (-0.02, 0.02), (0.0, 0.0)])
def test_a_fish_that_listens_knows_the_current_ahead_before_it_swims(current):
    water = drifted(np.array(current), 0.3, CONFIG.listen_time).water
    assert (water.current_x, water.current_y) == pytest.approx(current, abs=8e-3)


def test_a_fish_listens_at_rest_and_does_not_when_it_is_under_way():
    still, moving = Motion(0, 0, 0, 0.01, 0.0, 0), Motion(0, 0, 0, 0.15, 0.0, 0)
    assert not has_listened(1.0, still, CONFIG, np)
    assert has_listened(CONFIG.listen_time, still, CONFIG, np)
    assert has_listened(0.0, moving, CONFIG, np)
    assert has_listened(0.0, still, GuidanceConfig(learn_current=False), np)


def test_a_current_is_believed_up_to_its_limit_and_not_at_all_when_switched_off():
    assert learned(np.array([0.0, 0.5]), 0.0).water.current_y == CONFIG.current_limit
    off, motion = GuidanceConfig(learn_current=False), Motion(0, 0, 0, 0.2, 0.03, 0)
    state = observe(GuidanceState(), motion, Setpoint(0.0, 0.3), 0.01, LIMITS, off, np)
    assert state.water == WaterState()
    assert state.stroke.sway > 0.0


def test_through_the_water_a_robot_keeps_its_course_and_curvature_over_ground():
    """The velocity through the water plus the current is the wanted one, and so is its rate of turn."""
    state, u, kappa = GuidanceState(water=WaterState(0.0, -0.02, 0.03)), 0.15, 1.7
    current = np.array([state.water.current_x, state.water.current_y])

    def over_water(course):
        return through_water(state, course, kappa, u, np)

    course, step = 0.8, 1e-5
    w = over_water(course)
    ground = w.speed * np.array([np.cos(w.heading), np.sin(w.heading)]) + current
    np.testing.assert_allclose(ground, u * np.array([np.cos(course), np.sin(course)]), atol=1e-12)
    turning = (over_water(course + step).heading - over_water(course - step).heading) / (2 * step)
    assert w.curvature * w.speed == pytest.approx(turning * kappa * u, rel=1e-6)


def test_a_current_that_outruns_the_robot_is_not_believed_ahead():
    w = through_water(GuidanceState(water=WaterState(0.0, 0.1)), 0.0, 0.0, 0.1, np)
    assert (w.heading, w.speed) == pytest.approx((0.0, 0.03))


def test_casadi_and_numpy_give_the_same():
    sizes = [len(GUIDANCE_NAMES), len(Motion._fields), len(PathAhead._fields)]
    symbols = casadi.SX.sym("s", sum(sizes))

    def evaluate(v, xp):
        memory, moved, ahead = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
        start = GuidanceState().flat
        state = GuidanceState.of(
            [value + 0.001 * v[int(i)] for value, i in zip(start, memory, strict=True)]
        )
        motion, path = Motion(*(v[int(i)] for i in moved)), PathAhead(*(v[int(i)] for i in ahead))
        state = observe(state, motion, Setpoint(0.3, 0.4), 0.02, LIMITS, CONFIG, xp)
        errors = tracking_errors(state.stroke, motion, path, 0.2, CONFIG, xp)
        water = through_water(state, errors.course, path.curvature, 0.2, xp)
        return [*errors, *water, heading_error(state, motion, water, CONFIG, xp), *state.flat]

    function = casadi.Function("errors", [symbols], [casadi.vertcat(*evaluate(symbols, casadi))])
    for seed in range(5):
        values = np.random.default_rng(seed).normal(size=sum(sizes))
        np.testing.assert_allclose(
            function(values).full().ravel(),
            np.array(evaluate(values, np), dtype=float),
            rtol=1e-10,
            atol=1e-12,
        )


def test_config_names_field_and_value():
    with pytest.raises(ValueError, match=r"slip_arm is -0.1"):
        GuidanceConfig(slip_arm=-0.1)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "p.json"


def keep(keeper, *what):
    keeper.keep(*what)
    keeper.settle()


def test_what_is_kept_is_recalled_by_the_next_planner(file):
    keep(ProgressFile(file), "abc", 12.5, 1.25)
    assert ProgressFile(file).recall("abc", 14.0, oldest=10.0) == (1.25, 1.5)
    assert [f.name for f in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize(("digest", "time"), [("other", 14.0), ("abc", 23.0), ("abc", 12.0)])
def test_other_paths_old_progress_and_a_clock_behind_are_not_resumed(file, digest, time):
    keep(ProgressFile(file), "abc", 12.5, 1.25)
    assert ProgressFile(file).recall(digest, time, oldest=10.0) is None


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        '{"path": "a"}',
        '{"path": "a", "time": "x", "progress": 1}',
        '{"path": "a", "time": 1, "progress": -1}',
        '{"path": "a", "time": 1, "progress": NaN}',
    ],
)
def test_damaged_files_are_no_progress(file, content):
    file.write_text(content)
    assert ProgressFile(file).recall("a", 1.0, oldest=10.0) is None


def test_no_file_is_no_progress(file):
    assert ProgressFile(file).recall("a", 1.0, oldest=10.0) is None


def test_it_writes_five_times_a_second_and_at_once_when_the_clock_is_set_back(file):
    keeper = ProgressFile(file)
    for k in range(16):
        keep(keeper, "a", 100.0 + 0.0625 * k, float(k))
    assert json.loads(file.read_text())["progress"] == 12.0
    keep(keeper, "a", 1.0, 99.0)
    assert json.loads(file.read_text())["progress"] == 99.0


def test_a_folder_that_cannot_be_written_is_said_and_not_fatal(tmp_path):
    keeper = ProgressFile(tmp_path / "missing" / "p.json")
    keep(keeper, "a", 1.0, 0.5)
    assert "cannot be kept" in keeper.problem


def test_forgotten_progress_is_gone(file):
    keeper = ProgressFile(file)
    keeper.forget()
    keep(keeper, "a", 1.0, 0.5)
    keeper.forget()
    assert keeper.recall("a", 1.0, oldest=10.0) is None  # whether the disk is done with it or not
    keeper.settle()
    assert not file.exists()
    keep(keeper, "a", 2.0, 0.7)
    assert keeper.recall("a", 2.0, oldest=10.0) == (0.7, 0.0)


def test_what_is_being_written_is_forgotten_too(file, monkeypatch):
    stalled, goes_on = threading.Event(), threading.Event()
    rename = os.replace
    monkeypatch.setattr(
        os, "replace", lambda *args: stalled.set() or (goes_on.wait(10.0) and rename(*args))
    )
    keeper = ProgressFile(file)
    keeper.keep("a", 1.0, 0.5)
    assert stalled.wait(10.0)
    keeper.forget()  # returns: the disk is not waited for
    goes_on.set()
    keeper.settle()
    assert not file.exists()


def test_a_file_that_cannot_be_removed_is_said_and_not_fatal(tmp_path):
    keeper = ProgressFile(tmp_path)  # a folder
    keeper.forget()
    keeper.settle()
    assert f"cannot be removed from {tmp_path}" in keeper.problem


def test_a_disk_that_stalls_does_not_hold_up_the_planner(file, monkeypatch):
    stalled, goes_on = threading.Event(), threading.Event()

    def replace(*args):
        stalled.set()
        goes_on.wait()
        rename(*args)

    rename = os.replace
    monkeypatch.setattr(os, "replace", replace)
    keeper = ProgressFile(file)
    keeper.keep("a", 1.0, 0.5)
    assert stalled.wait(10.0)
    keeper.keep("a", 2.0, 0.7)  # returns, and is not queued behind the other
    goes_on.set()
    keeper.settle()
    assert ProgressFile(file).recall("a", 1.0, oldest=10.0) == (0.5, 0.0)
    keep(keeper, "a", 3.0, 0.9)
    assert ProgressFile(file).recall("a", 3.0, oldest=10.0) == (0.9, 0.0)


def test_digest_tells_paths_apart():
    digests = {path_digest(make_path(name)) for name in "IROS"} | {
        path_digest(make_path("O", end="stop"))
    }
    assert len(digests) == 5
    assert path_digest(make_path("R")) == path_digest(make_path("letter", letter="R"))


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


def swim_along(path, tracker, rng, offset=0.02, laps=1.0):
    """Progress reported to a robot that follows the path with random side steps."""
    s = np.arange(0.0, laps * path.length, 0.004)
    heading = path.heading_at(s)
    side = rng.uniform(-offset, offset, len(s))
    positions = path.point(s) + side[:, None] * np.column_stack([-np.sin(heading), np.cos(heading)])
    return s, side, [tracker.update(p) for p in positions]


@pytest.mark.parametrize("name", ["figure_eight", "A", "H", "T", "X", "R", "circle", "square_wave"])
def test_paths_that_cross_or_come_near_themselves_are_followed_in_order(name):
    path = make_path(name, end="stop")
    s, side, seen = swim_along(path, PathTracker(path), np.random.default_rng(1))
    progress = np.array([p.progress for p in seen])
    assert np.all(np.diff(progress) >= 0.0)
    np.testing.assert_allclose(progress, s, atol=0.03)
    np.testing.assert_allclose([p.cross_track_error for p in seen], side, atol=0.004)


def test_cross_track_error_is_positive_left_of_the_path():
    tracker = PathTracker(make_path("straight", length=2.0))
    assert tracker.update([-0.5, 0.1]).cross_track_error == pytest.approx(0.1)
    assert tracker.update([-0.5, -0.1]).cross_track_error == pytest.approx(-0.1)


def test_cross_track_error_of_a_circle_is_the_difference_of_radii():
    tracker = PathTracker(make_path("circle", radius=0.6))
    assert tracker.update([0.05, -0.75]).cross_track_error == pytest.approx(
        0.6 - np.hypot(0.05, 0.75), abs=1e-5
    )


def test_progress_waits_until_the_robot_has_reached_the_path():
    path = make_path("straight", length=3.0)
    tracker = PathTracker(path)
    far = tracker.update([1.0, 0.8])
    assert far.progress == 0.0
    np.testing.assert_allclose(far.target, path.point(0.0))
    assert tracker.update([-1.4, 0.1]).progress == pytest.approx(0.1, abs=1e-6)


def test_lookahead_point_is_the_lookahead_away_from_the_robot_and_ahead():
    path = make_path("S")
    tracker = PathTracker(path)
    rng = np.random.default_rng(2)
    for s in np.arange(0.0, path.length - 0.6, 0.01):
        position = path.point(s) + rng.normal(0.0, 0.02, 2)
        seen = tracker.update(position)
        assert np.hypot(*(seen.target - position)) == pytest.approx(0.4, abs=1e-3)
        assert tracker.nearest(seen.target, seen.progress) > seen.progress + 0.2


def test_lookahead_along_the_path():
    path = make_path("R")
    tracker = PathTracker(path, TrackerConfig(lookahead_mode="along"))
    seen = tracker.update(path.point(0.3) + [0.05, 0.0])
    np.testing.assert_allclose(seen.target, path.point(seen.progress + 0.4), atol=1e-4)


def test_lookahead_beyond_an_open_end_goes_straight_on():
    path = make_path("straight", length=1.0)
    tracker = PathTracker(path)
    tracker.reset(0.9)
    np.testing.assert_allclose(tracker.update([0.45, 0.0]).target, [0.85, 0.0], atol=1e-3)


def test_a_path_inside_the_lookahead_circle_gives_its_farthest_point():
    path = make_path("circle", radius=0.15)
    seen = PathTracker(path).update(path.point(0.0))
    np.testing.assert_allclose(seen.target, [0.0, 0.15], atol=2e-3)


def test_chord_of_a_circle_is_its_closed_form():
    path = make_path("circle", radius=0.6)
    seen = PathTracker(path).update(path.point(0.2))
    assert seen.chord == pytest.approx(np.arcsin(0.4 / (2 * 0.6)), abs=2e-3)


def test_open_path_that_stops_finishes_at_its_end_only():
    path = make_path("straight", length=1.0)
    tracker = PathTracker(path)
    states = [tracker.update([x, 0.02]) for x in np.arange(-0.5, 0.7, 0.01)]
    assert not any(p.finished for p in states if p.progress < 0.99)
    assert states[-1].finished
    assert states[-1].progress == pytest.approx(1.0)


def test_open_path_that_loops_starts_again():
    path = make_path("straight", length=1.0, end="loop")
    tracker = PathTracker(path)
    for x in np.arange(-0.5, 0.55, 0.01):
        tracker.update([x, 0.0])
    seen = tracker.update([0.55, 0.0])
    assert seen.progress == 0.0
    assert not seen.finished
    np.testing.assert_allclose(seen.target, [-0.5, 0.0], atol=1e-9)


def test_closed_path_keeps_counting_or_stops_after_a_lap():
    rng = np.random.default_rng(3)
    going = PathTracker(make_path("circle"))
    _, _, seen = swim_along(going.path, going, rng, laps=2.5)
    assert seen[-1].progress == pytest.approx(2.5 * going.path.length, abs=0.03)
    assert not seen[-1].finished
    once = PathTracker(make_path("circle", end="stop"))
    _, _, seen = swim_along(once.path, once, rng, laps=1.05)
    assert seen[-1].finished
    assert not seen[-60].finished


def test_reset_and_nearest_start_in_the_middle():
    path = make_path("figure_eight")
    tracker = PathTracker(path)
    left = np.array([-np.sin(path.heading_at(2.0)), np.cos(path.heading_at(2.0))])
    tracker.reset(tracker.nearest(path.point(2.0) + 0.05 * left))
    assert tracker.progress == pytest.approx(2.0, abs=0.01)
    assert tracker.update(path.point(2.1)).progress == pytest.approx(2.1, abs=1e-3)


@pytest.mark.parametrize("size", [1, 10])
def test_a_batch_gives_what_single_trackers_give(size):
    rng = np.random.default_rng(4)
    names = list("ABCDEFGHIO")[:size]
    paths = [make_path(name, end="loop") for name in names]
    batch, singles = PathBatch(paths), [PathTracker(path) for path in paths]
    for s in np.arange(0.0, 1.2, 0.02):
        position = np.array([path.point(s) for path in paths]) + rng.normal(0.0, 0.03, (size, 2))
        state = batch.update(position)
        for i, tracker in enumerate(singles):
            single = tracker.update(position[i])
            assert state.progress[i] == pytest.approx(single.progress, abs=1e-9)
            assert state.cross_track_error[i] == pytest.approx(single.cross_track_error, abs=1e-9)
            np.testing.assert_allclose(state.target[i], single.target, atol=1e-6)


@pytest.mark.parametrize(
    ("field", "value"), [("lookahead", 0.0), ("search_window", np.nan), ("lookahead_mode", "near")]
)
def test_tracker_config_names_field_and_value(field, value):
    with pytest.raises(ValueError, match=f"{field} is {value!r}"):
        TrackerConfig(**{field: value})
