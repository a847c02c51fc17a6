"""Errors of a robot that is where it should be are zero; others have the right sign and size."""

import casadi
import numpy as np
import pytest

from fish_control.line_of_sight import (
    GuidanceConfig,
    GuidanceState,
    Motion,
    PathAhead,
    observe,
    tracking_errors,
)
from fish_control.path_tracker import PathTracker
from fish_control.paths import make_path
from fish_control.stroke_mean import StrokeState

CONFIG = GuidanceConfig()


def ahead(path, position, s=None):
    tracker = PathTracker(path)
    if s is not None:
        tracker.reset(s)
    at = tracker.update(position)
    return PathAhead(at.x, at.y, at.heading, at.curvature, *at.target, at.chord)


def test_robot_on_a_straight_path_has_no_errors():
    path = make_path("straight", length=2.0, course=0.7)
    motion = Motion(*path.point(0.5), 0.7, 0.2, 0.0, 0.0)
    errors = tracking_errors(GuidanceState(), motion, ahead(path, path.point(0.5)), 0.2, CONFIG, np)
    np.testing.assert_allclose(errors, [0.0, 0.0, 0.0, 0.7], atol=1e-9)


@pytest.mark.parametrize("direction", [1, -1])
def test_robot_that_turns_steadily_on_a_circle_has_no_errors(direction):
    path = make_path("circle", radius=0.5, direction=direction)
    s = 1.0
    slip = CONFIG.slip_arm * direction / 0.5
    motion = Motion(*path.point(s), float(path.heading_at(s)) + slip, 0.2, 0.0, 0.0)
    errors = tracking_errors(GuidanceState(), motion, ahead(path, path.point(s), s), 0.2, CONFIG, np)
    assert errors.cross_track == pytest.approx(0.0, abs=1e-5)
    assert errors.heading == pytest.approx(0.0, abs=2e-3)


def test_the_papers_law_points_inside_the_circle_by_the_chord():
    path = make_path("circle", radius=0.5)
    motion = Motion(*path.point(1.0), float(path.heading_at(1.0)), 0.2, 0.0, 0.0)
    config = GuidanceConfig(compensate_curvature=False, slip_arm=0.0)
    errors = tracking_errors(GuidanceState(), motion, ahead(path, path.point(1.0), 1.0), 0.2, config, np)
    assert errors.heading == pytest.approx(np.arcsin(0.4 / (2 * 0.5)), abs=2e-3)


def test_a_robot_left_of_the_path_should_turn_right():
    path = make_path("straight", length=3.0)
    motion = Motion(0.0, 0.1, 0.0, 0.15, 0.0, 0.0)
    errors = tracking_errors(GuidanceState(), motion, ahead(path, [0.0, 0.1], 1.5), 0.2, CONFIG, np)
    assert errors.cross_track == pytest.approx(0.1)
    assert errors.heading == pytest.approx(-np.arcsin(0.1 / 0.4), abs=2e-3)
    assert errors.speed == pytest.approx(0.05)


def test_heading_error_is_the_short_way_round():
    path = make_path("straight", length=3.0)
    motion = Motion(0.0, 0.0, 2.0 * np.pi + 0.1, 0.2, 0.0, 0.0)
    errors = tracking_errors(GuidanceState(), motion, ahead(path, [0.0, 0.0], 1.5), 0.2, CONFIG, np)
    assert errors.heading == pytest.approx(-0.1, abs=1e-9)


def test_drift_of_a_cross_current_becomes_the_crab_angle():
    state = GuidanceState()
    for _ in range(1000):  # heading 0, the current carries the fish to its left with 0.03 m/s
        state = observe(state, Motion(0.0, 0.0, 0.0, 0.2, 0.03, 0.0), 0.01, CONFIG, np)
    assert state.drift == pytest.approx(0.03 * 0.2 / (0.2**2 + 0.05**2), rel=1e-3)


def test_a_steady_turn_in_still_water_is_no_drift():
    state, kappa, u = GuidanceState(), 2.0, 0.2
    turn = Motion(0.0, 0.0, 0.0, u, -CONFIG.slip_arm * kappa * u, kappa * u)
    for _ in range(1000):
        state = observe(state, turn, 0.01, CONFIG, np)
    assert state.drift == pytest.approx(0.0, abs=1e-9)


def test_drift_is_switched_off_by_its_time():
    state = observe(GuidanceState(), Motion(0, 0, 0, 0.2, 0.03, 0), 0.01, GuidanceConfig(drift_time=0.0), np)
    assert state.drift == 0.0


def test_casadi_and_numpy_give_the_same():
    names = [*StrokeState._fields, "drift", *Motion._fields, *PathAhead._fields]
    symbols = casadi.SX.sym("s", len(names))

    def evaluate(v, xp):
        state = GuidanceState(StrokeState(*(v[i] for i in range(4))), v[4])
        motion = Motion(*(v[i] for i in range(5, 11)))
        path = PathAhead(*(v[i] for i in range(11, 18)))
        state = observe(state, motion, 0.02, CONFIG, xp)
        return [*tracking_errors(state, motion, path, 0.2, CONFIG, xp), *state.stroke, state.drift]

    function = casadi.Function("errors", [symbols], [casadi.vertcat(*evaluate(symbols, casadi))])
    for seed in range(5):
        values = np.random.default_rng(seed).normal(size=len(names))
        np.testing.assert_allclose(
            function(values).full().ravel(),
            np.array(evaluate(values, np), dtype=float),
            rtol=1e-10,
            atol=1e-12,
        )


def test_config_names_field_and_value():
    with pytest.raises(ValueError, match="slip_arm is -0.1"):
        GuidanceConfig(slip_arm=-0.1)
