# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The score of a run against motions whose errors are known by construction."""

from dataclasses import replace

import numpy as np
import pytest

from fish_bag import message_build as build
from fish_bag import sample_recordings as samples
from fish_bag.trial import (
    NOT_FINITE,
    Odometry,
    ReferenceSpeed,
    Trial,
)
from fish_bag.trial import ReferencePath as RecordedPath
from fish_bringup.run_page import write_run_page
from fish_bringup.score import (
    Summary,
    commanded_speed,
    error_table,
    path_from_points,
    score_motion,
    score_trial,
    what_is_missing,
)
from fish_control.path_tracker import stroke_mean
from fish_control.paths import make_path
from fish_control.reference_path import ReferencePath
from fish_report import robofish as command
from fish_report.errors import UserError

STRAIGHT = ReferencePath.from_points([[-1.0, 0.0], [1.0, 0.0]], name="straight")


def motion(t, x, y, psi, u):
    t, x, y, psi, u = np.broadcast_arrays(
        *(np.asarray(value, dtype=float) for value in (t, x, y, psi, u))
    )
    zero = np.zeros(len(t))
    return Odometry(
        topic="/fish/sim/odometry",
        frame_id="pool",
        t=t,
        t_arrival=t,
        flags=np.zeros(len(t), np.uint8),
        x=x,
        y=y,
        psi=psi,
        u=u,
        v=zero,
        r=zero,
    )


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


def test_a_table_of_a_run_that_did_not_come_to_the_end_of_its_path_says_how_far_it_came():
    t = np.arange(0.0, 20.0, 0.01)
    moved = motion(t, -1.0 + np.minimum(0.2 * t, 2.2), 0.0, 0.0, 0.2)
    whole, half = (
        error_table(score_motion(moved.take(t < end), STRAIGHT, 0.2, 0.0, "truth")).note
        for end in (20.0, 5.0)
    )
    assert "ended at" not in whole
    assert "ended at 1.00 m of a path of 2.00 m" in half


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("last", ["path", "heading", "speed"])
def test_approach_ends_when_path_heading_and_speed_are_all_near(last, side):
    t = np.arange(0.0, 9.0, 0.01)
    near = {name: 4.0 if name == last else 1.0 for name in ("path", "heading", "speed")}  # s
    y = np.maximum(0.05 + 0.05 * (near["path"] - t), 0.0)  # m, within 0.05 m from then on
    psi = -np.maximum(0.3 + 0.1 * (near["heading"] - t), 0.0)
    u = 0.2 - np.maximum(0.04 + 0.02 * (near["speed"] - t), 0.0)
    u = 0.2 + side * (u - 0.2)
    score = score_motion(
        motion(t, -1.0 + 0.2 * t, side * y, side * psi, u), STRAIGHT, 0.2, 0.0, "truth"
    )
    assert score.approach_s == pytest.approx(4.0, abs=0.03)
    settled, whole = score.summaries(with_approach=False), score.summaries(with_approach=True)
    assert settled["cross-track, m"].maximum == pytest.approx(
        0.05 if last == "path" else 0.0, abs=1e-3
    )
    assert whole["cross-track, m"].maximum == pytest.approx(0.05 + 0.05 * near["path"])


def test_before_the_path_begins_nothing_has_settled():
    t = np.arange(0.0, 9.0, 0.01)
    score = score_motion(motion(t, -1.3 + 0.2 * t, 0.0, 0.0, 0.2), STRAIGHT, 0.2, 0.0, "truth")
    assert score.approach_s == pytest.approx(0.3 / 0.2, abs=0.03)


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
    assert np.abs(score.heading).max() <= 0.01 + 1e-6


def test_a_self_crossing_path_is_followed_in_order():
    path = make_path("figure_eight")
    s = np.linspace(0.0, path.length, 3000)
    x, y = path.point(s).T
    score = score_motion(motion(s / 0.2, x, y, path.heading_at(s), 0.2), path, 0.2, 0.0, "truth")
    assert np.abs(score.cross_track).max() < 1e-3
    assert np.all(np.diff(score.progress) > -1e-9)


def test_stroke_mean_of_a_parabola_is_its_integral_also_at_the_ends():
    """(b^3 - a^3) / 3 (b - a) between a and b, a quarter of a second to both sides where there is as much."""
    t = np.r_[np.arange(0.0, 2.0, 0.01), np.arange(2.0, 5.0, 0.02)]
    a, b = np.maximum(t - 0.25, t[0]), np.minimum(t + 0.25, t[-1])
    assert stroke_mean(t, t**2) == pytest.approx(
        (b**3 - a**3) / (3.0 * (b - a)), rel=2e-4, abs=2e-4
    )


def test_the_mean_over_a_single_sample_is_that_sample():
    assert stroke_mean(np.array([1.0]), np.array([0.3])) == pytest.approx([0.3])


def test_path_from_points_knows_closed_paths():
    assert path_from_points(make_path("circle").points).closed
    assert not path_from_points(make_path("letter", letter="S").points).closed


@pytest.mark.parametrize(
    ("missing", "said"),
    [
        ({"truth": None}, "neither sim/odometry nor odometry/filtered was recorded"),
        ({"reference_paths": ()}, "reference/path was not recorded"),
        ({"reference_speed": None}, "reference/speed was not recorded"),
    ],
)
def test_what_is_missing_is_named(tmp_path, missing, said):
    t = np.arange(0.0, 3.0, 0.01)
    trial = recorded_run(tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t]))
    with pytest.raises(UserError, match=f"^a: {said}"):
        score_trial(replace(trial, **missing))


def test_samples_of_which_none_can_be_used_are_not_taken_for_absent(tmp_path):
    t = np.arange(0.0, 3.0, 0.01)
    trial = recorded_run(tmp_path, STRAIGHT.points, t, np.full((300, 2), np.nan))
    useless = replace(trial.truth, flags=np.full(300, NOT_FINITE, np.uint8))
    with pytest.raises(UserError, match="a: none of 300 samples of /fish/sim/odometry can be used"):
        score_trial(replace(trial, truth=useless))


def test_a_table_with_holes_is_told_by_what_is_missing(tmp_path):
    t = np.arange(0.0, 9.0, 0.01)
    aside = recorded_run(
        tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t + 0.31]), end=9.0
    )
    said = what_is_missing(score_trial(aside))
    assert "approach phase never ended: within 9.0 s" in said
    assert "0.31 m" in said
    assert not any("nan" in cell for row in error_table(score_trial(aside)).rows for cell in row)
    on_path = recorded_run(
        tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t]), end=9.0
    )
    assert what_is_missing(score_trial(on_path)) is None


def swum(folder, asides):
    """A recording of 9 s in which each namespace's robot swims so far [m] beside the straight path."""
    messages = []
    for namespace, aside in asides.items():
        messages += [
            (0, f"{namespace}/reference/path", build.path(0, "pool", STRAIGHT.points)),
            (0, f"{namespace}/reference/speed", build.number(0.2)),
        ]
        messages += [
            (
                samples.ns(t),
                f"{namespace}/sim/odometry",
                build.odometry(samples.ns(t), (0.2 * t - 1.0, aside, 0.0), (0.2, 0.0, 0.0)),
            )
            for t in np.arange(0.0, 9.0, 0.01)
        ]
    return samples.write_mcap(folder, sorted(messages, key=lambda message: message[0]))


@pytest.mark.parametrize(("aside", "status"), [(0.0, 0), (0.31, 1)])
def test_the_command_refuses_a_run_that_never_came_onto_its_path(tmp_path, capsys, aside, status):
    recording = swum(tmp_path / "a", {"/fish": aside})
    assert command.main(["score", str(recording), "--out", str(tmp_path / "page.html")]) == status
    said = capsys.readouterr()
    assert ("a: the approach phase never ended" in said.err) == bool(status)
    assert ("RMSE" in said.out) == (tmp_path / "page.html").exists() == (not status)
    assert "nan" not in said.out


def test_the_page_replaces_no_file_of_the_recording(tmp_path, capsys):
    recording = swum(tmp_path / "a", {"/fish": 0.0})
    for file in [path for path in recording.rglob("*") if path.is_file()]:
        before = file.read_bytes()
        assert command.main(["score", str(recording), "--out", str(file)]) == 1
        assert f"{file.name} is the input" in " ".join(capsys.readouterr().err.split())
        assert file.read_bytes() == before


def test_one_of_two_recorded_robots_is_scored(tmp_path, capsys):
    recording = swum(tmp_path / "a", {"/one": 0.01, "/two": 0.02})
    for namespace, error in (("/one", "0.0100"), ("/two", "0.0200")):
        words = ["score", str(recording), "--out", str(tmp_path / "page.html")]
        assert command.main([*words, "--namespace", namespace]) == 0
        row = next(line for line in capsys.readouterr().out.splitlines() if "cross-track" in line)
        assert error in row


def test_a_run_without_a_wanted_speed_or_a_pose_on_its_path_is_refused(tmp_path):
    t = np.arange(0.0, 3.0, 0.01)
    trial = recorded_run(tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t]))
    at_rest = replace(trial.reference_speed, speed=np.zeros(2))
    with pytest.raises(UserError, match="a: the commanded speed was never above 0"):
        score_trial(replace(trial, reference_speed=at_rest))
    late = replace(trial.reference_paths[0], t=5.0)
    with pytest.raises(UserError, match="no pose was recorded after the path was given"):
        score_trial(replace(trial, reference_paths=(late,)))


def test_truth_is_scored_where_there_is_one_and_else_the_estimate(tmp_path):
    t = np.arange(0.0, 3.0, 0.01)
    trial = recorded_run(
        tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t]), end=9.0
    )
    beside = motion(t, 0.2 * t - 1.0, 0.03, 0.0, 0.2)
    for odometry, truth, source, offset in (
        (beside, trial.truth, "truth", 0.0),
        (beside, None, "estimate", 0.03),
    ):
        score = score_trial(replace(trial, odometry=odometry, truth=truth))
        assert score.source == source
        assert score.cross_track == pytest.approx(offset, abs=1e-9)


def test_the_last_commanded_speed_is_the_one_of_the_last_path(tmp_path):
    """A first path that ended with a speed of 0, then another at 0.25 m/s until 0 is said again, just before the end."""
    t = np.arange(0.0, 6.3, 0.01)
    trial = recorded_run(tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t]))
    stamps = np.array([0.0, 1.0, 3.0, 6.0])
    speeds = replace(
        trial.reference_speed,
        t=stamps,
        t_arrival=stamps,
        flags=np.zeros(4, np.uint8),
        speed=np.array([0.2, 0.0, 0.25, 0.0]),
    )
    paths = (
        replace(trial.reference_paths[0], points=STRAIGHT.points + 0.5),
        replace(trial.reference_paths[0], t=2.0),
    )
    score = score_trial(replace(trial, reference_speed=speeds, reference_paths=paths))
    assert set(score.reference_speed) == {0.25}
    assert score.finished
    assert (score.t[0], score.t[-1]) == pytest.approx((2.0, 6.0))


def changing_speed(tmp_path):
    """0.1 m/s for 5 s, then 0.2 m/s on the same path, the fish exactly as fast as it is told to be; 0 at the end."""
    t = np.arange(0.0, 12.5, 0.01)
    x = -1.0 + 0.1 * t + 0.1 * np.maximum(t - 5.0, 0.0)
    trial = recorded_run(tmp_path, STRAIGHT.points, t, np.column_stack([x, 0.0 * t]))
    stamps = np.array([0.5, 5.0, 12.4])
    said = replace(
        trial.reference_speed,
        t=stamps,
        t_arrival=stamps,
        flags=np.zeros(3, np.uint8),
        speed=np.array([0.1, 0.2, 0.0]),
    )
    return replace(
        trial, truth=motion(t, x, 0.0, 0.0, np.where(t < 5.0, 0.1, 0.2)), reference_speed=said
    )


def test_a_speed_that_changes_on_the_way_is_wanted_from_then_on(tmp_path):
    score = score_trial(changing_speed(tmp_path))
    assert score.approach_s < 0.05
    assert np.abs(score.speed_error).max() < 1e-9
    # before the first is said it is wanted already, and still when 0 is said at the end
    assert (score.t[0], score.reference_speed[0]) == (0.0, 0.1)
    assert (score.t[-1], score.reference_speed[-1]) == pytest.approx((12.4, 0.2))


def test_the_page_shows_every_speed_that_was_wanted(tmp_path):
    trial = changing_speed(tmp_path)
    write_run_page(tmp_path / "page.html", "a", trial, score_trial(trial), [])
    assert "12.4 s at 0.10 to 0.20 m/s" in (tmp_path / "page.html").read_text()


def test_a_single_speed_is_wanted_throughout_whatever_zeros_are_said(tmp_path):
    """Nothing of a recording with one speed depends on when it was said."""
    t = np.arange(0.0, 9.0, 0.01)
    trial = recorded_run(tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t]))
    for stamps, speeds in (
        ([0.0, 8.0], [0.2, 0.0]),
        ([0.0, 3.0, 8.0], [0.0, 0.2, 0.0]),
        ([0.0, 2.0, 4.0], [0.2, 0.0, 0.2]),
    ):
        said = replace(
            trial.reference_speed,
            t=np.array(stamps),
            speed=np.array(speeds),
            t_arrival=np.array(stamps),
            flags=np.zeros(len(stamps), np.uint8),
        )
        assert set(commanded_speed(said, t)) == {0.2}


def test_a_speed_of_0_that_was_said_before_the_path_does_not_end_it(tmp_path):
    t = np.arange(0.0, 5.0, 0.01)
    trial = recorded_run(tmp_path, STRAIGHT.points, t, np.column_stack([0.2 * t - 1.0, 0.0 * t]))
    score = score_trial(replace(trial, reference_paths=(replace(trial.reference_paths[0], t=2.0),)))
    assert score.t[-1] == pytest.approx(4.99)
    assert not score.finished


def test_a_closed_path_is_followed_from_where_the_fish_is():
    path = make_path("circle", radius=0.5)
    s = np.linspace(0.3 * path.length, 0.9 * path.length, 1000)
    x, y = (path.point(s) * 0.96).T  # within the circle: left of a path that goes round to the left
    score = score_motion(motion(s / 0.2, x, y, path.heading_at(s), 0.2), path, 0.2, 0.0, "truth")
    assert score.progress == pytest.approx(s, abs=5e-3)
    assert score.cross_track == pytest.approx(0.04 * 0.5, abs=1e-4)
    assert not score.finished


def test_a_path_without_enough_points_is_an_error_the_user_can_read(tmp_path):
    with pytest.raises(
        UserError, match="reference/path cannot be scored against: got 0 points; expected"
    ):
        score_trial(recorded_run(tmp_path, np.zeros((0, 2)), np.arange(3.0), np.zeros((3, 2))))


def test_an_open_path_that_ends_where_it_begins_is_over_when_the_planner_says_so(tmp_path):
    path = make_path("letter", letter="B")
    t = np.arange(0.0, path.length / 0.2 + 20.0, 0.02)  # 20 s of rest at the end
    score = score_trial(
        recorded_run(
            tmp_path,
            path.points,
            t,
            path.point(np.minimum(0.2 * t, path.length)),
            path.length / 0.2,
        )
    )
    assert score.finished
    assert score.t[-1] == pytest.approx(path.length / 0.2, abs=0.03)
    assert score.summaries(with_approach=True)["speed, m/s"].rmse < 1e-9


def recorded_run(folder, points, t, position, end=1.0):
    """A trial that moves through positions (N, 2) at 0.2 m/s until the planner says 0 at `end` [s]."""
    stamps = np.array([0.0, end])
    speed = ReferenceSpeed(
        topic="s",
        frame_id="",
        t=stamps,
        t_arrival=stamps,
        flags=np.zeros(2, np.uint8),
        speed=np.array([0.2, 0.0]),
    )
    truth = motion(t, *np.transpose(position), 0.0, np.where(t <= end, 0.2, 0.0))
    common = {
        "path": folder,
        "origin_ns": 0,
        "duration": float(t[-1]),
        "namespace": "/fish",
        "axis": "robot",
    }
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
    common = {
        "path": tmp_path,
        "origin_ns": 0,
        "duration": 11.0,
        "namespace": "/fish",
        "axis": "robot",
    }
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
    score = score_trial(
        Trial(name="a", truth=truth, reference_speed=speed, reference_paths=paths, **common)
    )
    assert score.t[0] == pytest.approx(0.5)
    assert score.finished
    assert score.approach_s == pytest.approx(0.01)  # it is swum along from its second sample on
    assert set(score.reference_speed) == {0.2}
