# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the camera's point lies on the head, and poses of the centre of mass from it."""

from __future__ import annotations

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import ahead_of, at_centre_of_mass, forward, with_marker
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.known_effects import known_effects
from fish_sysid.diagnosis.task import make_task
from fish_sysid.estimation.ekf_types import Noise


@pytest.fixture(scope="module")
def swum() -> Experiment:
    random = np.random.default_rng(2)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def test_a_point_ahead_of_one_that_looks_along_y_lies_along_y() -> None:
    pose = np.array([[0.4, -0.2, np.pi / 2], [0.0, 0.0, np.pi]])
    assert forward(pose, 0.03) == pytest.approx(
        np.array([[0.4, -0.17, np.pi / 2], [-0.03, 0.0, np.pi]])
    )


def test_places_add_up_and_none_leaves_no_entry() -> None:
    robot = with_marker(with_marker(Robot(), -0.02), -0.01)
    assert ahead_of(robot) == pytest.approx(-0.03)
    assert with_marker(robot, 0.03).sensors == {}


def test_a_diagnosis_starts_from_poses_of_the_centre_of_mass(swum: Experiment) -> None:
    """The IMU's clock and the point are the robot's own, and no effects that the filter could fit."""
    robot = with_marker(Robot(), -0.03).with_effect("imu_latency", delay=0.02)
    assert known_effects(robot) == ()
    task = make_task(at_centre_of_mass(swum, 0.03), robot, names=["current"])
    assert ahead_of(task.robot) == 0.0
    for seen, true in zip(task.experiment.frames, swum.frames, strict=True):
        assert seen.pose == pytest.approx(true.pose, abs=1e-12)
