# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When an open-loop swim begins, and what ends it."""

from dataclasses import replace

import numpy as np
import pytest

from fish_control.excitation import Excitation, Program, Row
from fish_control.exciter import Exciter, Sight
from fish_control.line_of_sight import Motion
from fish_control.node_configs import ExciterConfig
from fish_control.pool import HALF_LENGTH
from fish_control.watchdog import EstimateHealth

DT = 0.01  # s
SURE = EstimateHealth(0.01, True, 1e-5, 1e-4)
MIDDLE = Sight(Motion(0.0, 0.0, 0.0, 0.2, 0.0, 0.0), SURE)


def doubtful(**changes):
    return replace(MIDDLE, signs=replace(SURE, **changes))


def exciter(**parameters):
    config = ExciterConfig(rest=0.5, **parameters)
    return Exciter(config, Excitation(Program((Row(0.0, 8.0, 2.0, 0.3),)), 0.0, 2.0))


def swim(running, seconds, sight, begin=0.0):
    """Commands (T, 3) of a while: phase, rotor speed, rudder."""
    times = begin + DT * np.arange(round(seconds / DT))
    return np.array([running.command(float(t), DT, sight) for t in times])


def test_it_rests_swims_its_part_and_ends_at_rest():
    running = exciter()
    assert not swim(running, 1.0, None)[:, 1:].any()
    assert running.state == "waiting"
    assert not swim(running, 0.49, MIDDLE, begin=1.0)[:, 1:].any()
    assert running.reason == "at rest"
    strokes = swim(running, 1.99, MIDDLE, begin=1.5)
    assert running.reason == "swimming"
    assert strokes[-1, 2] == 0.3
    assert np.abs(strokes[:, 1]).max() > 60.0
    end = swim(running, 2.0, MIDDLE, begin=3.5)
    assert running.state == "ended"
    assert running.reason == "ended at 2.0 s, as programmed"
    assert not end[-10:, 1:].any()


def test_it_begins_when_the_robot_is_armed():
    running = exciter()
    for k in range(300):
        assert running.command(DT * k, DT, MIDDLE, "not armed since the start").rotor_speed == 0.0
    assert running.reason == "waiting for the robot to be armed: not armed since the start"
    assert not swim(running, 0.49, MIDDLE, begin=3.0)[:, 1:].any()
    assert np.abs(swim(running, 1.0, MIDDLE, begin=3.49)[:, 1]).max() > 60.0


def test_a_robot_that_is_disarmed_on_the_way_ends_the_swim_for_good():
    running = exciter()
    swim(running, 1.5, MIDDLE)
    running.command(1.5, DT, MIDDLE, "coil at 90 deg C")
    assert running.state == "disarmed"
    assert running.reason == "stopped at 1.0 s: disarmed: coil at 90 deg C"
    assert not swim(running, 4.0, MIDDLE, begin=1.51)[-10:, 1:].any()


@pytest.mark.parametrize(
    ("sight", "state", "said"),
    [
        (
            replace(MIDDLE, motion=Motion(HALF_LENGTH - 0.215, 0.0, 0.0, 0.2, 0.0, 0.0)),
            "before a wall",
            "at (1.92, 0.00) m",
        ),
        (doubtful(finite=False), "lost", "odometry is not finite"),
        (doubtful(age=0.6), "lost", "odometry is stale: 0.60 s old, 0.5 s allowed"),
        (doubtful(age=-5.0), "lost", "odometry is from the future: stamped 5.00 s ahead"),
        (doubtful(pose_variance=1e4), "lost", "camera lost"),
        (doubtful(twist_variance=1e4), "lost", "IMU lost"),
    ],
)
def test_a_reason_stops_it_for_good(sight, state, said):
    running = exciter()
    swim(running, 1.5, MIDDLE)
    held = swim(running, 0.02, sight, begin=1.5)[:, 2]
    assert abs(held[-1]) == (pytest.approx(0.8) if state == "before a wall" else 0.0)  # rad
    after = swim(running, 4.0, MIDDLE, begin=1.52)
    assert running.state == state
    assert running.reason.startswith("stopped at 1.0 s")
    assert said in running.reason
    assert not after[-10:, 1:].any()


def test_nothing_stops_it_before_it_swims_or_without_its_guard():
    running = exciter()
    swim(running, 0.4, doubtful(age=9.0))
    swim(running, 0.5, MIDDLE, begin=0.4)
    assert running.state == "swimming"
    blind = exciter(guard=False)
    swim(blind, 1.0, None)
    assert blind.state == "swimming"
