# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The whole chain without ROS: simulated fish, noisy and delayed sensors, fusion, planner, controller."""

import numpy as np
import pytest
from closed_loop import swim

from fish_control.hand_tuned import hand_tuned_policy
from fish_control.line_of_sight import GuidanceConfig
from fish_control.paths import make_path

POLICY = hand_tuned_policy()


def test_the_letter_r_from_rest():
    score = swim(make_path("R"), 0.2, POLICY)
    assert score.finished
    assert score.cross_track_rmse < 0.015  # m; 0.009 when this was written, 0.03 asked for
    assert (
        score.speed_rmse < 0.022
    )  # m/s; 0.017, of which 0.016 is the stroke's own swing in the bends
    assert score.estimate_rmse < 0.004  # m; one camera frame is off by 0.0028


def test_a_slow_camera_costs_little():
    score = swim(make_path("S"), 0.2, POLICY, camera_latency=0.3)
    assert score.finished
    assert score.cross_track_rmse < 0.018
    assert score.speed_rmse < 0.022


def test_compensated_line_of_sight_beats_the_papers():
    path = make_path("S")
    paper = swim(path, 0.25, POLICY, guidance=GuidanceConfig(compensate_curvature=False))
    ours = swim(path, 0.25, POLICY)
    assert ours.cross_track_rmse < 0.5 * paper.cross_track_rmse


@pytest.mark.parametrize("start", [(-1.2, 0.5, 2.6), (-1.9, 0.6, -1.57)])
def test_from_a_pose_beside_the_path_that_faces_away(start):
    record = []
    score = swim(make_path("straight", length=3.4), 0.2, POLICY, start=start, record=record)
    rows = np.array(record)
    settled = rows[rows[:, 0] > 1.5]
    assert score.finished
    assert len(rows) < 3000
    assert np.abs(settled[:, 1]).max() < 0.05


@pytest.mark.parametrize("seed", [2])
def test_water_that_pushes(seed):
    score = swim(make_path("I"), 0.15, POLICY, seed=seed, disturbance=0.01)
    assert score.finished
    assert score.cross_track_rmse < 0.02
