# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Numbers on pages: in the units of their headings, at the right place, and what could not be had left empty."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fish_bag import read_trial
from fish_bag import sample_recordings as samples
from fish_bag.problem import Problem
from fish_bag.recording_page import (
    clocks_table,
    figures,
    over_time,
    path_figure,
    problems_table,
    timing_figure,
    topics_table,
    trials_table,
)
from fish_bag.trial import DataSet, Odometry, Trial
from fish_bringup.run_page import (
    _lead,
    _pool,
    _pool_note,
    _speed,
)
from fish_bringup.score import score_motion
from fish_control.reference_path import ReferencePath
from fish_sim.robot import Robot
from fish_sysid.prediction.prediction import ErrorSizes
from fish_sysid.reports.diagnosis_figures import program, water_over_the_pool, when_it_acts
from fish_sysid.reports.identify_tables import bias_table, error_table, parameter_table


def test_prediction_errors_are_in_millimetres_and_milliradians() -> None:
    rms = np.array([[0.0123, 0.045, 0.0067], [0.2, np.nan, 0.03]])
    sizes = ErrorSizes((1.0, 5.0), rms, np.zeros((2, 2, 3)), np.array([[4, 1], [5, 0]]))
    table = error_table({"identified": sizes, "arx_ahead": sizes})
    assert table.header == [
        "predictor",
        "mm 1 s",
        "mrad 1 s",
        "mm/s 1 s",
        "mm 5 s",
        "mrad 5 s",
        "mm/s 5 s",
        "predictions",
    ]
    assert table.rows[0] == ["physics, identified", "12.3", "45", "6.7", "200", "", "30", "9 / 1"]
    assert table.rows[1][0] == "linear ARX, with 0.5 s of what comes"
    assert " after 1 and 5 s, " in table.note
    assert "which the baselines are usually given" in table.note


def test_the_caption_of_predictions_speaks_of_nothing_that_is_not_there() -> None:
    sizes = ErrorSizes((2.0,), np.ones((1, 3)), np.zeros((2, 1, 3)), np.ones((2, 1)))
    note = error_table({"model": sizes}).note
    assert " after 2 s, " in note
    assert "starts from what was measured before." in note
    assert "below" not in note
    assert "baselines" not in note


def test_parameters_stand_beside_their_errors_their_start_and_whether_they_are_known() -> None:
    values = {"head_drag_surge": 0.3, "current.x": -0.02}
    errors = {"head_drag_surge": 0.006, "current.x": 0.001}
    fit = SimpleNamespace(values=values, standard_errors=errors, robot=Robot())
    start = Robot().with_parameters(head_drag_surge=0.2)
    rows = parameter_table(
        SimpleNamespace(fit=fit, start=start, undetermined=("current.x",), predicted=None)
    ).rows
    assert rows[0] == ["head_drag_surge", "0.3", "0.006", "N s/m", "1.500", "2 %", ""]
    assert rows[1] == ["current.x", "-0.02", "0.001", "", "", "5 %", "not determined by these data"]


def test_biases_stand_with_their_trial() -> None:
    estimates = SimpleNamespace(
        bias=np.array([[0.001, -0.02, 0.03]]), bias_std=np.array([[1e-4, 2e-3, 3e-3]])
    )
    found = SimpleNamespace(training=SimpleNamespace(names=("a",)), estimates=estimates)
    assert bias_table(found).rows == [
        ["a", "+0.0010 ± 0.0001", "-0.0200 ± 0.0020", "+0.0300 ± 0.0030"]
    ]


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return read_trial(samples.robot_recording(tmp_path_factory.mktemp("reports") / "swum"))


def test_topics_are_told_with_rate_gap_and_latency_in_milliseconds(trial: Trial) -> None:
    rows = {row[0]: row[1:] for row in topics_table(trial).rows}
    assert rows["/fish/imu/data"] == ("sensor_msgs/Imu", "imu", "200", "100", "10", "2/2/2")
    assert rows["/fish/control/gains"][-1] == "no stamps"
    assert list(rows) == sorted(rows)


def test_clocks_and_trials_are_told(trial: Trial) -> None:
    by_clock = {row[0]: row[1:] for row in clocks_table(trial).rows}
    assert by_clock["camera"][0].startswith("0.025000 ± ")
    assert by_clock["camera"][2] == "no"
    data = DataSet("set", Path("set"), (trial,))
    (row,) = trials_table(data).rows
    assert row[:3] == ("swum", f"{trial.duration:.2f}", str(len(samples.robot_messages())))
    assert row[4] == "0 0 0"
    troubled = DataSet(
        "set", Path("set"), (replace(trial, problems=(Problem("warning", "gap", "", ""),) * 2),)
    )
    assert trials_table(troubled).rows[0][4] == "0 2 0"
    found = Problem("info", "gap", "/a", "a pause", t=1.23456)
    assert problems_table("p", (found,)).rows == (("info", "gap", "/a", "a pause", "1.235"),)


def test_figures_of_a_recording_show_what_was_measured(trial: Trial) -> None:
    path = {line.name: line for line in path_figure(trial).data}
    np.testing.assert_allclose(path["camera"].x, samples.pose(trial.camera.t)[:, 0], atol=1e-9)
    np.testing.assert_array_equal(path["reference"].y, [0.0, 0.5, 0.5])
    timing = {line.name: line for line in timing_figure(trial).data}
    np.testing.assert_allclose(timing["camera latency"].y, 25.0, atol=1e-4)  # ms
    np.testing.assert_allclose(timing["imu period"].y, 10.0, atol=1e-4)
    titles = [figure.title for figure in figures(trial)]
    assert titles == [
        f"swum: {what}"
        for what in ("path in the pool", "measurements and commands", "latency and period")
    ]


def test_flagged_samples_are_marked_and_long_lines_thinned() -> None:
    t = 0.001 * np.arange(20000)
    flags = np.zeros(20000, np.uint8)
    flags[[5, 777]] = 4
    long = Odometry(
        topic="/o",
        frame_id="pool",
        t=t,
        t_arrival=t,
        flags=flags,
        **dict.fromkeys("xyuvr", t),
        psi=t,
    )
    line, marks = over_time([("speed", [("u", long, long.u)])]).data
    assert 6000 <= len(line.x) < 12000
    assert line.x[0] == 0.0
    assert marks.x.tolist() == [0.005, 0.777]


@pytest.fixture(scope="module")
def run():
    """2 m along x at 0.2 m/s, 10 cm beside the path for the first 5 s."""
    path = ReferencePath.from_points([[-1.0, 0.0], [1.0, 0.0]], name="straight")
    t = np.arange(0.0, 9.0, 0.01)
    zero, beside = np.zeros(len(t)), np.where(t < 5.0, 0.1, 0.0)
    truth = Odometry(
        topic="x",
        frame_id="pool",
        t=t,
        t_arrival=t,
        flags=zero.astype(np.uint8),
        x=-1.0 + 0.2 * t,
        y=beside,
        psi=zero,
        u=zero + 0.19,
        v=zero,
        r=zero,
    )
    return score_motion(truth, path, 0.2, 0.0, "truth")


def test_the_page_of_a_run_sets_the_approach_apart(run) -> None:
    lines = {line.name: line for line in _pool(run).data}
    assert max(lines["approach"].y) == 0.1
    assert max(np.abs(lines["swum"].y)) == 0.0
    assert lines["approach"].x[-1] == lines["swum"].x[0]  # one line, in two colours
    assert (lines["start"].x[0], lines["start"].y[0]) == (-1.0, 0.1)
    assert _lead(run) == (
        "9.0 s at 0.20 m/s, 1.80 m of the path; the fish did not end on the path's end. "
        "Scored against the simulator's true pose."
    )
    assert [line.y[100] for line in _speed(run).data] == pytest.approx([0.19, 0.19, 0.2])
    assert _pool_note(run) == f"The approach phase took {run.approach_s:.1f} s."
    assert 4.0 < run.approach_s < 5.1
    assert "never ended" in _pool_note(SimpleNamespace(approach_s=np.nan))


def test_the_next_experiment_is_drawn_until_its_last_row_is_over() -> None:
    rows = [
        {"t": 0.0, "amplitude": 7.0, "frequency": 2.0, "rudder": 0.5},
        {"t": 20.0, "amplitude": 7.0, "frequency": 2.0, "rudder": -0.5},
    ]
    lines = {line.name: line for line in program({"next_experiment": {"program": rows}}).data}
    assert lines["rudder"].y == (0.5, -0.5, -0.5)
    assert lines["rudder"].line.shape == "hv"
    assert lines["rudder"].x[:2] == (0.0, 20.0)
    assert lines["rudder"].x[2] > 20.0


def test_intervals_are_drawn_on_their_trials() -> None:
    where = {
        "time": [
            {"trial": "b", "from": 1.0, "to": 3.5, "share": 0.7},
            {"trial": "a", "from": 2.0, "to": 3.0, "share": 0.3},
        ],
        "covariates": [{"name": "wall_distance", "range": [0.05, 0.21], "f1": 0.93}],
    }
    figure = when_it_acts({"name": "wall_effect", "where": where})
    (bars,) = figure.figure.data
    assert bars.y == ("a", "b")
    assert bars.base == (2.0, 1.0)
    assert bars.x == (1.0, 2.5)
    assert "wall_distance from 0.05 to 0.21 tells them best (F1 0.93)" in figure.note


def test_the_water_is_drawn_as_it_flows() -> None:
    """The same arrow everywhere for a current, as long as it is fast, along it."""
    effect = {"name": "current", "parameters": {"x": {"value": 0.03}, "y": {"value": -0.04}}}
    seen = SimpleNamespace(
        force=SimpleNamespace(covariates={"x": np.zeros((20, 2)), "y": np.ones((20, 2))})
    )
    drawn = water_over_the_pool(effect, seen)
    assert drawn.note.startswith("longest arrow: 0.05 m/s")
    arrows, fish = drawn.figure.data
    along = np.array([[arrows.x[1] - arrows.x[0], arrows.y[1] - arrows.y[0]]])
    assert along[0] / np.linalg.norm(along) == pytest.approx([0.6, -0.8])
    assert set(fish.y) == {1.0}
