# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a recording of a program lacks, on recordings with one thing taken away."""

from dataclasses import replace

import numpy as np
import pytest

from fish_bag.trial import (
    NOT_FINITE,
    Camera,
    Commands,
    Imu,
    Odometry,
    Trial,
)
from fish_bringup.excite_check import LONGEST_GAPS, commands_of, incomplete
from fish_control.excitation import Program, Row
from fish_control.pool import HALF_WIDTH
from fish_sim.model import DT

PROGRAM = Program((Row(0.0, 5.0, 2.0, 0.0), Row(3.0, 6.0, 2.5, 0.4)))
BEGIN, END = 1.0, 9.0
REST = 100  # commands at rest before the first stroke


def stream(kind, topic, t, **arrays):
    return kind(
        topic=topic, frame_id="", t=t, t_arrival=t, flags=np.zeros(len(t), np.uint8), **arrays
    )


@pytest.fixture
def trial(tmp_path):
    """A whole recording: a second at rest, the program, two seconds of gliding."""
    told = np.concatenate(
        [np.zeros((REST, 3)), commands_of(PROGRAM, BEGIN, END), np.zeros((200, 3))]
    )
    t = 0.013 + DT * np.arange(len(told))
    nothing, frames = np.zeros(len(t)), np.arange(0.0, t[-1], 1.0 / 30.0)
    still = np.zeros(len(frames))
    return Trial(
        name="a",
        path=tmp_path,
        origin_ns=0,
        duration=float(t[-1]),
        namespace="/fish",
        axis="robot",
        commands=stream(
            Commands,
            "/fish/joint_command",
            t,
            rotor_phase=told[:, 0],
            rotor_speed=told[:, 1],
            rudder=told[:, 2],
        ),
        imu=stream(
            Imu,
            "/fish/imu/data",
            t,
            gyro=np.zeros((len(t), 3)),
            accel=np.zeros((len(t), 3)),
            orientation=np.zeros((len(t), 4)),
        ),
        camera=stream(
            Camera,
            "/fish/camera/pose",
            frames,
            x=still,
            y=still,
            psi=still,
            covariance=np.zeros((len(frames), 3, 3)),
        ),
        truth=stream(
            Odometry,
            "/fish/sim/odometry",
            t,
            x=nothing,
            y=nothing,
            psi=nothing,
            u=nothing,
            v=nothing,
            r=nothing,
        ),
    )


def without(stream, first, last):
    """Less the samples from `first` to `last` [s] on the recording's axis."""
    return stream.take((stream.t < first) | (stream.t > last))


def lacks(trial, **changed):
    return incomplete(replace(trial, **changed), PROGRAM, BEGIN, END)


def test_a_whole_recording_lacks_nothing(trial):
    assert lacks(trial) == []


@pytest.mark.parametrize("count", [1, 14])
def test_lost_commands_are_said_with_their_time(trial, count):
    kept = np.delete(np.arange(len(trial.commands)), np.arange(REST + 250, REST + 250 + count))
    (said,) = lacks(trial, commands=trial.commands.take(kept))
    assert (
        f"missing from 2.50 to {2.5 + DT * count:.2f} s after the first stroke ({count} commands)"
        in said
    )


def test_the_first_commands_are_missed_too(trial):
    kept = np.delete(np.arange(len(trial.commands)), [REST, REST + 1, REST + 2])
    (said,) = lacks(trial, commands=trial.commands.take(kept))
    assert "missing from 0.00 to 0.03 s" in said


def test_a_command_at_another_time_is_missing_at_its_own(trial):
    t = trial.commands.t.copy()
    t[REST + 100] += 0.004
    (said,) = lacks(trial, commands=replace(trial.commands, t=t))
    assert "missing from 1.00 to 1.01 s" in said


def test_a_command_that_cannot_be_read_is_missing(trial):
    flags = trial.commands.flags.copy()
    flags[REST + 100] = NOT_FINITE
    assert "(1 commands)" in lacks(trial, commands=replace(trial.commands, flags=flags))[0]


def test_commands_of_somebody_else_are_not_the_programs(trial):
    rudder = trial.commands.rudder.copy()
    rudder[REST + 400 : REST + 410] = -0.3
    (said,) = lacks(trial, commands=replace(trial.commands, rudder=rudder))
    assert said.startswith("10 of 800 commands are not the program's, the first 4.00 s after")


def test_a_row_that_begins_a_command_late_is_the_programs(trial):
    rudder = trial.commands.rudder.copy()
    rudder[REST + 200] = rudder[REST + 199]  # the row of 3 s, the program began at 1 s
    assert rudder[REST + 199] != rudder[REST + 201]
    assert lacks(trial, commands=replace(trial.commands, rudder=rudder)) == []


@pytest.mark.parametrize("role", LONGEST_GAPS)
def test_a_sensor_that_is_silent_or_absent_is_said(trial, role):
    sensor, longest = getattr(trial, role), LONGEST_GAPS[role]
    assert lacks(trial, **{role: without(sensor, 4.0, 4.0 + 0.5 * longest)}) == []
    (said,) = lacks(trial, **{role: without(sensor, 4.0, 4.0 + 1.1 * longest)})
    assert f"{sensor.topic} is silent for" in said
    assert f"expected {longest:g} s at most" in said
    (said,) = lacks(trial, **{role: without(sensor, 5.0, np.inf)})
    assert "is silent for" in said
    assert lacks(trial, **{role: None}) == [f"nothing of the {role} was recorded"]


def test_a_fish_at_a_wall_swam_in_no_free_water(trial):
    y = trial.truth.y.copy()
    y[REST + 300 : REST + 320] = HALF_WIDTH
    (said,) = lacks(trial, truth=replace(trial.truth, y=y))
    assert said == "the fish touched a wall at 4.00 s of the program"


def test_a_recording_without_commands_or_strokes_is_said(trial):
    assert lacks(trial, commands=None) == ["no joint_command was recorded"]
    at_rest = replace(trial.commands, rotor_phase=np.zeros(len(trial.commands)))
    assert lacks(trial, commands=at_rest) == ["no joint_command turns the rotor"]
