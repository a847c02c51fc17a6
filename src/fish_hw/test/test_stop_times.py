# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every cause stops the rotor in time and is latched; driver and emulated module on one simulated clock."""

import itertools

import pytest

from fish_hw.emulators.lockstep_rotor import DT, SETTINGS, LockstepRotor
from fish_hw.emulators.stop_causes import CAUSES, limit_s, stop

UNSAID = ("SIGTERM to node rotor", "SIGKILL to node rotor")  # nobody is left to say it


@pytest.mark.parametrize("cause", CAUSES)
def test_every_cause_stops_the_rotor_in_time_and_names_itself(cause):
    for seed in range(2):
        one = stop(cause, seed)
        assert one.last_command_s <= limit_s(cause)
        assert one.coasting_s <= limit_s(cause) + 0.05
        assert bool(one.reason) == (cause not in UNSAID)


def swimming() -> LockstepRotor:
    robot = LockstepRotor()
    robot.driver.connect()
    robot.run(1.0)
    assert robot.arm() == ""
    robot.run(1.3)
    return robot


def moved(robot: LockstepRotor, since: float) -> bool:
    return any(v != 0.0 for t, v in robot.module.commanded_at if t > since)


@pytest.mark.parametrize("back", ["camera/pose", "joint_command", "odometry/filtered"])
def test_what_is_back_does_not_start_the_rotor(back):
    robot = swimming()
    robot.silent.add(back)
    robot.run(1.0)
    robot.silent.clear()
    stopped = robot.clock.now
    robot.run(3.0)
    assert not moved(robot, stopped)
    assert robot.arm() == ""
    robot.run(0.5)
    assert moved(robot, stopped)


def test_no_jump_of_the_command_over_a_lost_port_and_late_cycles():
    robot = swimming()
    for _ in range(3):
        robot.line.unplugged = True
        robot.run(0.8)
        robot.line.unplugged = False
        robot.run(2.0)
        assert robot.arm() == ""
        robot.run(1.0)
        robot.clock.now += 0.12  # the computer stalls
        robot.run(0.5)
    sent = robot.module.commanded_at
    assert len(sent) > 300
    most = SETTINGS.max_acceleration * 1.5 * DT + 1e-6
    jumps = [
        (a, b)
        for a, b in itertools.pairwise(sent)
        if abs(b[1] - a[1]) > most and abs(b[1]) > abs(a[1])
    ]
    assert jumps == []
