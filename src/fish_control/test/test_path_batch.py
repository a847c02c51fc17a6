# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Progress, cross-track error and lookahead."""

import numpy as np
import pytest

from fish_control.path_batch import PathBatch, TrackerConfig
from fish_control.path_tracker import PathTracker
from fish_control.paths import make_path


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
def test_config_names_field_and_value(field, value):
    with pytest.raises(ValueError, match=f"{field} is {value!r}"):
        TrackerConfig(**{field: value})
