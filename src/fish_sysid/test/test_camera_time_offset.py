# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sensors laid over each other before anything is fitted: camera and gyro, a rolling IMU, a rotor that runs down."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fish_sim.robot import Robot
from fish_sysid.dataset.camera import DELAYS, align, misfits, moved_back
from fish_sysid.dataset.commands import driven, standing
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.grid import level
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise


def experiment_with_delay(delay: float) -> Experiment:
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 12.0, random) for kind in ("sines", "random")], axis=1)
    made = record(Robot(), commands, Noise(), random)[0]
    frames = tuple(Frames(f.t + delay, f.pose) for f in made.frames)
    return Experiment(**{**vars(made), "frames": frames})


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.49, 0.7])
def test_delay_of_the_camera_comes_back_even_beyond_a_stroke(delay: float) -> None:
    assert align(experiment_with_delay(delay)).delay == pytest.approx(delay, abs=0.011)


def test_the_delay_is_the_nearest_of_those_that_are_tried() -> None:
    """A sum of samples is the integral up to half a step after the last one; taken for a whole step it costs 5 ms."""
    found = [align(experiment_with_delay(delay)).delay for delay in (0.122, 0.128)]
    assert found == pytest.approx([0.12, 0.13])


@pytest.mark.parametrize("delay", [0.02, 1.1])
def test_a_delay_below_a_frame_or_beyond_what_is_looked_for_is_not_stated(delay: float) -> None:
    """The first is left to the filter; the best of all that were tried is not the delay where it is the last of them."""
    assert align(experiment_with_delay(delay)).delay == 0.0


def test_without_a_gyro_no_delay_is_stated() -> None:
    late = experiment_with_delay(0.3)
    blind = Experiment(**{**vars(late), "gyro": np.full_like(late.gyro, np.nan)})
    assert align(blind).delay == 0.0


def test_windows_in_which_the_gyro_says_nothing_are_left_out() -> None:
    """The first sample held over a gyro's late start or a hole is a turn that the fish did not make."""
    late = experiment_with_delay(0.3)
    gyro = late.gyro.copy()
    gyro[:130], gyro[130] = np.nan, 5.0
    gyro[700:760, 1] = np.nan
    holed = Experiment(**{**vars(late), "gyro": gyro})
    whole, _ = misfits(late)
    rest, count = misfits(holed)
    best = DELAYS[np.nanargmin(np.nansum(rest * count[:, None], axis=0))]
    assert best == pytest.approx(0.3, abs=0.011)
    assert np.nanmin(rest) < 2.0 * whole.min()
    assert count.tolist() == [1, 0]


def test_images_move_back_and_those_before_the_start_go() -> None:
    late = experiment_with_delay(0.3)
    back = moved_back(late, 0.5)
    assert back.frames[0].t[0] >= 0.0
    assert len(late.frames[0].t) - len(back.frames[0].t) == pytest.approx(
        6, abs=1
    )  # 0.2 s at 30 Hz


def test_gravity_of_a_rolling_imu_is_taken_out() -> None:
    roll, yaw = 0.1 * np.sin(np.linspace(0.0, 6.0, 50)), 0.7
    half_roll, half_yaw = 0.5 * roll, 0.5 * yaw
    quaternion = np.column_stack(
        [  # yaw, then roll about the new x axis
            np.cos(half_yaw) * np.sin(half_roll),
            np.sin(half_yaw) * np.sin(half_roll),
            np.sin(half_yaw) * np.cos(half_roll),
            np.cos(half_yaw) * np.cos(half_roll),
        ]
    )
    left, up, r = 0.4, 9.81, 1.5
    accel = np.column_stack(
        [
            np.full(50, 0.2),
            left * np.cos(roll) + up * np.sin(roll),
            up * np.cos(roll) - left * np.sin(roll),
        ]
    )
    gyro = np.column_stack([np.zeros(50), r * np.sin(roll), r * np.cos(roll)])
    rate, force = level(SimpleNamespace(gyro=gyro, accel=accel, orientation=quaternion))  # type: ignore[arg-type]
    np.testing.assert_allclose(rate, r, atol=1e-12)
    np.testing.assert_allclose(force, np.tile([0.2, left], (50, 1)), atol=1e-12)


def test_encoder_replaces_a_command_that_stands_while_the_rotor_runs_down() -> None:
    t = 0.01 * np.arange(400)
    command = np.where(t < 2.0, 50.0 * np.sin(12.0 * t), 40.0)
    encoder = np.where(t < 2.0, command, 40.0 * np.exp(-(t - 2.0)))
    encoder[1::3] = np.nan
    speed, left = driven(command, encoder)
    assert standing(command) == [(200, 400)]
    np.testing.assert_array_equal(speed[:200], command[:200])
    np.testing.assert_allclose(speed[200:398], 40.0 * np.exp(-(t[200:398] - 2.0)), atol=0.01)
    assert np.isnan(left[200:]).all()
    assert np.isfinite(left[:200]).any()


@pytest.mark.parametrize(("apart", "replaced"), [(4.0, False), (6.0, True), (-6.0, True)])
def test_a_constant_command_stays_as_long_as_the_rotor_follows_it(
    apart: float, replaced: bool
) -> None:
    command = np.full(200, 40.0)
    speed, left = driven(command, command + apart)
    np.testing.assert_array_equal(speed, command + apart if replaced else command)
    assert np.isfinite(left).any() != replaced


def test_a_rotor_that_is_told_to_stand_runs_down_in_the_model() -> None:
    command, encoder = np.zeros(300), 40.0 * np.exp(-0.01 * np.arange(300))
    speed, left = driven(command, encoder)
    assert not speed.any()
    assert np.array_equal(left, encoder)


def test_half_a_second_of_the_same_command_is_no_forgotten_one() -> None:
    command = np.r_[np.full(50, 20.0), np.full(51, 30.0)]
    assert standing(command) == [(50, 101)]
