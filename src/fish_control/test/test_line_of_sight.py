# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Errors of a robot that is where it should be are zero; others have the right sign and size."""

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
from fish_control.path_tracker import PathTracker
from fish_control.paths import make_path
from fish_control.stroke_mean import TURN_LAG, StrokeState

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
