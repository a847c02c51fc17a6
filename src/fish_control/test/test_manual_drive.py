# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Driving by hand: set-points from keys, rest without the operator."""

import math

import numpy as np
import pytest

from fish_control.manual_drive import STEPS, ManualDrive


def swim(drive, begin, seconds, hold=True):
    """Commands of 100 Hz (N, 2): rotor speed [rad/s], rudder [rad]."""
    rows = []
    for k in range(round(100 * seconds)):
        now = begin + 0.01 * k
        if hold:
            drive.hold(now)
        command = drive.command(now, 0.01)
        rows.append((command.rotor_speed, command.alpha))
    return np.array(rows)


def test_keys_change_throttle_and_rudder_in_steps():
    drive = ManualDrive(0.5)
    assert all(drive.press("up") for _ in range(3))
    assert drive.press("left")
    assert (drive.throttle, drive.rudder) == pytest.approx((3 / STEPS, 1 / STEPS))
    for _ in range(2 * STEPS):
        drive.press("down")
        drive.press("right")
    assert (drive.throttle, drive.rudder) == (0.0, -1.0)


def test_any_other_key_is_rest_at_once():
    drive = ManualDrive(0.5)
    drive.press("up")
    assert not drive.press(" ")
    assert (drive.throttle, drive.rudder) == (0.0, 0.0)


def test_a_held_deadman_swims_and_steers_left():
    drive = ManualDrive(0.5)
    drive.wish(0.5, 0.5)
    moved = swim(drive, 0.0, 1.0)
    assert np.abs(moved[:, 0]).max() > 20.0
    assert moved[-1, 1] == pytest.approx(0.4)


def test_without_the_operator_it_comes_to_rest_within_time_out_and_run_down():
    drive = ManualDrive(0.3)
    drive.wish(1.0, 1.0)
    swim(drive, 0.0, 1.0)
    silent = swim(drive, 1.0, 1.0, hold=False)
    assert np.abs(silent[:25, 0]).max() > 20.0
    assert np.abs(silent[-10:]).max() == 0.0
    drive.hold(2.0)  # back again: from rest
    assert drive.command(2.0, 0.01).rotor_speed == 0.0


@pytest.mark.parametrize("wish", [(math.nan, math.nan), (math.inf, -math.inf)])
def test_what_is_no_number_is_rest(wish):
    drive = ManualDrive(0.5)
    drive.wish(*wish)
    assert (drive.throttle, drive.rudder) == (0.0, 0.0)


@pytest.mark.parametrize("timeout", [0.0, 10.0, math.nan])
def test_a_time_out_that_is_none_is_refused(timeout):
    with pytest.raises(ValueError, match=r"expected 0\.05 to 5 s"):
        ManualDrive(timeout)
