"""What of the given robot is refitted: its nominal parameters, and of its own effects what the recordings tell."""

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.known_effects import given_hypothesis, own_effects, told
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import NOMINAL_FREE


@pytest.fixture(scope="module")
def swum():
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 4.0, random) for kind in ("sines", "steps")], axis=1)
    return record(Robot(), commands, Noise(), random)[0]


def test_a_robot_without_effects_is_refitted_as_ever(swum):
    hypothesis = given_hypothesis(Robot(), swum, Noise())
    assert hypothesis.free == NOMINAL_FREE
    assert own_effects(hypothesis.robot) == ()


def test_own_effects_are_free_as_far_as_the_recordings_tell_of_them(swum):
    """The line is never taut and no command reaches the limit: free, the prior would take both away."""
    robot = (
        Robot().with_effect("rudder_offset", offset=0.06).with_effect("camera_latency", delay=0.03)
    )
    robot = robot.with_effect("tether", stiffness=0.3, length=4.0).with_effect(
        "rudder_saturation", limit=0.79
    )
    hypothesis = given_hypothesis(robot, swum, Noise())
    assert hypothesis.free == (*NOMINAL_FREE, "rudder_offset.offset", "camera_latency.delay")
    assert hypothesis.robot.effects["tether"] == robot.effects["tether"]
    assert set(hypothesis.names) == {
        "rudder_offset",
        "camera_latency",
        "tether",
        "rudder_saturation",
    }


def test_of_two_that_are_known_together_alone_one_is_held():
    """Mass times place: each is as unsure as its prior, and the one is told where the other is held; a drag stays free anyway."""
    prior = np.array([0.5, 4.0, 4.0])
    normal = np.diag(1.0 / prior**2)
    normal[1:, 1:] += 1e4 * np.array([[1.0, 0.9], [0.9, 0.81]])
    assert told(normal, prior, range(1, 3)) in ([0, 1], [0, 2])
    assert told(np.diag(1.0 / prior**2), prior, range(1, 3)) == [0]
    assert told(normal + 100.0 * np.eye(3), prior, range(1, 3)) == [0, 1, 2]
