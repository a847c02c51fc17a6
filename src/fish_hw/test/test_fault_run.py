# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Faults of a whole robot on one simulated clock, and the counts of what must never happen."""

import pytest

from fish_hw.emulators.fault_run import RAMP_S, FaultRun, moved_while_disarmed, speed_changes

# a module that restarts into a fault, and faults that the robot swims through
BEARABLE = {"computer stalls", "imu errors", "imu bits", "imu reset", "rotor garbage"}


def test_after_every_fault_the_robot_swims_again_when_it_is_armed(tmp_path):
    run = FaultRun(tmp_path)
    for name in sorted(run.robot.faults):
        run.fault(name)
    counts = run.counts
    assert set(counts.done) == set(run.robot.faults)
    assert set(counts.done) - set(counts.disarmed) <= BEARABLE
    assert (counts.crashes, counts.not_recovered) == ([], [])
    assert (counts.moved_disarmed, counts.over_limits) == (0, 0)


def test_a_driver_that_raises_and_one_that_drives_disarmed_are_counted(tmp_path):
    run = FaultRun(tmp_path)
    run.robot.faults["mistake"] = lambda: setattr(run.robot, "speed", lambda _: 1 / 0)
    run.fault("mistake")
    assert "ZeroDivisionError" in run.counts.crashes[0]


@pytest.mark.parametrize(("late_s", "count"), [(RAMP_S - 0.01, 0), (RAMP_S + 0.01, 1)])
def test_motion_after_the_ramp_of_a_disarmed_robot_is_counted(late_s, count):
    states = [(0.0, True), (1.0, False), (1.1, False), (2.0, True)]
    sent = [(0.5, 50.0), (1.0 + late_s, 3.0), (1.9, 0.0), (2.1, 20.0)]
    assert moved_while_disarmed(states, sent) == count


def test_a_command_after_a_silence_starts_from_rest():
    sent = [(0.0, 10.0), (0.01, 30.0), (0.02, -5.0), (2.0, -12.0)]
    assert speed_changes(sent) == [20.0, 0.0, 12.0]
