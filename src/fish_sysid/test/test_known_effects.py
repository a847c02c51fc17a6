# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What of the given robot is refitted: its nominal parameters, and of its own effects what the recordings determine."""

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.known_effects import identifiable, known_effects, start_hypothesis
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE


@pytest.fixture(scope="module")
def swum():
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def test_a_robot_without_effects_has_its_nominal_parameters_free(swum):
    hypothesis = start_hypothesis(Robot(), swum, Noise())
    assert hypothesis.free == NOMINAL_FREE
    assert known_effects(hypothesis.robot) == ()


def test_own_effects_are_free_as_far_as_the_recordings_determine_them(swum):
    """The line is never taut and no command reaches the limit: free, the prior would take both away."""
    robot = (
        Robot().with_effect("rudder_offset", offset=0.06).with_effect("camera_latency", delay=0.03)
    )
    robot = robot.with_effect("tether", stiffness=0.3, length=4.0).with_effect(
        "rudder_saturation", limit=0.79
    )
    hypothesis = start_hypothesis(robot, swum, Noise())
    assert hypothesis.free == (*NOMINAL_FREE, "rudder_offset.offset", "camera_latency.delay")
    assert hypothesis.robot.effects["tether"] == robot.effects["tether"]
    assert set(hypothesis.names) == {
        "rudder_offset",
        "camera_latency",
        "tether",
        "rudder_saturation",
    }


def test_of_two_that_are_identifiable_only_together_one_is_held():
    """Mass times place: each is as unsure as its prior; the one is identifiable where the other is held. A drag stays free."""
    prior = np.array([0.5, 4.0, 4.0])
    normal = np.diag(1.0 / prior**2)
    normal[1:, 1:] += 1e4 * np.array([[1.0, 0.9], [0.9, 0.81]])
    assert identifiable(normal, prior, range(1, 3)) in ([0, 1], [0, 2])
    assert identifiable(np.diag(1.0 / prior**2), prior, range(1, 3)) == [0]
    assert identifiable(normal + 100.0 * np.eye(3), prior, range(1, 3)) == [0, 1, 2]
