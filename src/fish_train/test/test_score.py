"""The score of a run against motions whose errors are known by construction."""

from dataclasses import replace

import numpy as np
import pytest

from fish_control.paths import make_path
from fish_control.reference_path import ReferencePath
from fish_train.errors import UserError
from fish_train.recordings.trial import Odometry, ReferenceSpeed, Trial
from fish_train.recordings.trial import ReferencePath as RecordedPath
from fish_train.score import Summary, path_from_points, score_motion, score_trial, stroke_mean

STRAIGHT = ReferencePath.from_points([[-1.0, 0.0], [1.0, 0.0]], name="straight")


def motion(t, x, y, psi, u):
    t, x, y, psi, u = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in (t, x, y, psi, u)))
    zero = np.zeros(len(t))
    return Odometry(
        topic="/fish/sim/odometry", frame_id="pool", t=t, t_arrival=t, flags=np.zeros(len(t), np.uint8),
        x=x, y=y, psi=psi, u=u, v=zero, r=zero,
    )  # fmt: skip


def test_summary_of_a_sine_has_the_sine_s_rms_and_percentile():
    error = 0.03 * np.sin(np.linspace(0.0, 20.0 * np.pi, 100_001))
    summary = Summary.of(error)
    assert summary.rmse == pytest.approx(0.03 / np.sqrt(2.0), rel=1e-3)
    assert summary.p95 == pytest.approx(0.03 * np.sin(0.95 * np.pi / 2.0), rel=1e-3)
    assert summary.maximum == pytest.approx(0.03, rel=1e-6)


def test_offset_from_a_straight_line_is_the_cross_track_error():
    t = np.arange(0.0, 9.0, 0.01)
    score = score_motion(motion(t, -1.0 + 0.2 * t, 0.02, 0.1, 0.19), STRAIGHT, 0.2, 0.0, "truth")
    assert score.cross_track == pytest.approx(0.02)  # left of the path: positive
    assert score.heading == pytest.approx(-0.1)
    assert score.speed_error == pytest.approx(0.01)
    assert not score.finished


def test_samples_after_the_end_of_an_open_path_do_not_count():
    t = np.arange(0.0, 20.0, 0.01)
    x = -1.0 + np.minimum(0.2 * t, 2.2)
    y = np.where(t > 11.0, 0.5, 0.0)  # drifts away after the end
    score = score_motion(motion(t, x, y, 0.0, 0.2), STRAIGHT, 0.2, 0.0, "truth")
    assert score.finished
    assert score.t[-1] == pytest.approx(10.0, abs=0.03)
    assert np.abs(score.cross_track).max() < 1e-9


def test_approach_ends_when_path_and_speed_are_both_near():
    t = np.arange(0.0, 9.0, 0.01)
    y = np.maximum(0.2 - 0.1 * t, 0.0)  # within 0.05 m from 1.5 s on
    u = np.minimum(0.04 * t, 0.2)  # above 0.16 m/s from 4 s on
    score = score_motion(motion(t, -1.0 + 0.2 * t, y, 0.0, u), STRAIGHT, 0.2, 0.0, "truth")
    assert score.approach_s == pytest.approx(4.0, abs=0.03)
    settled, whole = score.summaries(with_approach=False), score.summaries(with_approach=True)
    assert settled["cross-track, m"].maximum == pytest.approx(0.0, abs=1e-9)
    assert whole["cross-track, m"].maximum == pytest.approx(0.2)


def test_a_run_that_never_settles_says_so():
    t = np.arange(0.0, 3.0, 0.01)
    score = score_motion(motion(t, -1.0, 0.0, 0.0, 0.0), STRAIGHT, 0.2, 0.0, "truth")
    assert np.isnan(score.approach_s)
    assert np.isnan(score.summaries(with_approach=False)["speed, m/s"].rmse)


def test_swing_of_the_head_is_in_the_head_angle_and_not_in_the_mean_heading():
    t = np.arange(0.0, 9.0, 0.01)
    psi = 0.2 * np.sin(4.0 * np.pi * t)
    score = score_motion(motion(t, -1.0 + 0.2 * t, 0.0, psi, 0.2), STRAIGHT, 0.2, 0.0, "truth")
    inner = slice(50, -50)
    assert np.std(score.head_angle[inner]) == pytest.approx(0.2 / np.sqrt(2.0), rel=0.01)
    assert np.abs(score.heading[inner]).max() < 2e-3


def test_headings_are_compared_across_the_seam():
    t = np.arange(0.0, 4.0, 0.01)
    west = ReferencePath.from_points([[1.0, 0.0], [-1.0, 0.0]], name="west")
    psi = np.where(np.arange(len(t)) % 2, np.pi - 0.01, -np.pi + 0.01)
    score = score_motion(motion(t, 1.0 - 0.2 * t, 0.0, psi, 0.2), west, 0.2, 0.0, "truth")
    assert np.abs(score.head_angle).max() == pytest.approx(0.01, abs=1e-6)


def test_a_self_crossing_path_is_followed_in_order():
    path = make_path("figure_eight")
    s = np.linspace(0.0, path.length, 3000)
    x, y = path.point(s).T
    score = score_motion(motion(s / 0.2, x, y, path.heading_at(s), 0.2), path, 0.2, 0.0, "truth")
    assert np.abs(score.cross_track).max() < 1e-3
    assert np.all(np.diff(score.progress) > -1e-9)


def test_stroke_mean_of_a_ramp_is_the_ramp():
    t = np.arange(0.0, 5.0, 0.01)
    assert stroke_mean(t, 3.0 * t)[50:-50] == pytest.approx(3.0 * t[50:-50], abs=1e-9)


def test_path_from_points_knows_closed_paths():
    assert path_from_points(make_path("circle").points).closed
    assert not path_from_points(make_path("letter", letter="S").points).closed


def test_what_is_missing_is_named(tmp_path):
    trial = Trial(name="a", path=tmp_path, origin_ns=0, duration=1.0, namespace="/fish", axis="robot")
    with pytest.raises(UserError, match="odometry"):
        score_trial(trial)


def test_a_path_without_enough_points_is_an_error_the_user_can_read(tmp_path):
    with pytest.raises(UserError, match="reference/path cannot be scored against: got 0 points; expected"):
        score_trial(recorded_run(tmp_path, np.zeros((0, 2)), np.arange(3.0), np.zeros((3, 2))))


def test_an_open_path_that_ends_where_it_begins_is_over_when_the_planner_says_so(tmp_path):
    path = make_path("letter", letter="B")
    t = np.arange(0.0, path.length / 0.2 + 20.0, 0.02)  # 20 s of rest at the end
    score = score_trial(
        recorded_run(
            tmp_path, path.points, t, path.point(np.minimum(0.2 * t, path.length)), path.length / 0.2
        )
    )
    assert score.finished and score.t[-1] == pytest.approx(path.length / 0.2, abs=0.03)
    assert score.summaries(with_approach=True)["speed, m/s"].rmse < 1e-9


def recorded_run(folder, points, t, position, end=1.0):
    """A trial that moves through positions (N, 2) at 0.2 m/s until the planner says 0 at `end` [s]."""
    stamps = np.array([0.0, end])
    speed = ReferenceSpeed(
        topic="s", frame_id="", t=stamps, t_arrival=stamps, flags=np.zeros(2, np.uint8), speed=np.array([0.2, 0.0])
    )  # fmt: skip
    truth = motion(t, *np.transpose(position), 0.0, np.where(t <= end, 0.2, 0.0))
    common = dict(path=folder, origin_ns=0, duration=float(t[-1]), namespace="/fish", axis="robot")
    return Trial(
        name="a",
        truth=truth,
        reference_speed=speed,
        reference_paths=(RecordedPath(0.0, points, "pool"),),
        **common,
    )


def test_a_path_that_is_said_again_does_not_start_the_run_anew(tmp_path):
    t = np.arange(0.0, 11.0, 0.01)
    line = RecordedPath(0.0, STRAIGHT.points, "pool")
    other = RecordedPath(0.0, STRAIGHT.points + 0.5, "pool")
    common = dict(path=tmp_path, origin_ns=0, duration=11.0, namespace="/fish", axis="robot")
    truth = motion(t, -1.0 + 0.2 * t, 0.01, 0.0, 0.2)
    speed = ReferenceSpeed(
        topic="s",
        frame_id="",
        t=t[:2],
        t_arrival=t[:2],
        flags=np.zeros(2, np.uint8),
        speed=np.array([0.2, 0.0]),
    )
    paths = (other, replace(line, t=0.5), replace(line, t=5.0))
    score = score_trial(Trial(name="a", truth=truth, reference_speed=speed, reference_paths=paths, **common))
    assert score.t[0] == pytest.approx(0.5) and score.finished
    assert score.reference_speed == 0.2
