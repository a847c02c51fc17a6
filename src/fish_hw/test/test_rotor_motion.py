# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Jam, stuck encoder and runaway are told from a rotor that lags, on simulated time."""

import math

import pytest

from fish_hw.devices.rotor_watch import MotionCheck
from fish_hw.devices.vertiq import RotorSample

DT = 0.01
FREQUENCY = 2.0 * math.tau  # rad/s


def oscillation(t: float) -> float:
    return 9.0 * FREQUENCY * math.sin(FREQUENCY * t)


class Rotor:
    """A rotor with a first-order lag, commanded at 100 Hz; `seen` may falsify its samples."""

    def __init__(self, lag_s: float) -> None:
        self.lag_s, self.speed, self.angle, self.t = lag_s, 0.0, 0.0, 0.0
        self.check = MotionCheck()

    def run(self, duration_s: float, command=oscillation, seen=lambda sample: sample) -> tuple:
        """Time from the begin to the first complaint, and the complaint."""
        begin = self.t
        while self.t - begin < duration_s - DT / 2:
            sent = command(self.t)
            self.t += DT
            self.speed += (sent - self.speed) * (1.0 - math.exp(-DT / self.lag_s))
            self.angle += self.speed * DT
            said = self.check.add(sent, seen(RotorSample(self.t, self.angle, self.speed)))
            if said:
                return self.t - begin, said
        return None, ""


@pytest.mark.parametrize("lag_s", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("amplitude", [0.1, 1.0])
def test_a_rotor_that_lags_is_well(lag_s, amplitude):
    assert Rotor(lag_s).run(5.0, lambda t: amplitude * oscillation(t)) == (None, "")


@pytest.mark.parametrize("phase", [0.0, 0.06, 0.125, 0.19])
def test_a_jam_is_noticed_within_a_fifth_of_a_second(phase):
    rotor = Rotor(0.02)
    rotor.run(1.0 + phase)
    angle = rotor.angle
    after, said = rotor.run(1.0, seen=lambda s: RotorSample(s.time_s, angle, 0.0))
    assert "jammed" in said or "stuck" in said
    assert after <= 0.21


@pytest.mark.parametrize("phase", [0.0, 0.06, 0.125, 0.19])
def test_a_speed_that_stands_still_is_noticed_though_the_angle_moves(phase):
    rotor = Rotor(0.02)
    rotor.run(1.0 + phase)
    speed = rotor.speed
    after, said = rotor.run(1.0, seen=lambda s: RotorSample(s.time_s, s.angle, speed))
    assert "measured speed stands still" in said
    assert after <= 0.2


def test_an_angle_that_stands_still_is_noticed_though_the_speed_moves():
    rotor = Rotor(0.02)
    rotor.run(1.0)
    angle = rotor.angle
    after, said = rotor.run(1.0, seen=lambda s: RotorSample(s.time_s, angle, s.velocity))
    assert "encoder stuck" in said
    assert after <= 0.21


def test_a_steady_speed_is_not_stuck_in_the_moment_in_which_its_command_changes():
    """The sample is taken when the new command arrives: the rotor cannot have followed yet."""
    check = MotionCheck()
    for k in range(40):
        assert check.add(60.0, RotorSample(DT * k, 0.6 * k, 60.0)) == ""
    assert check.add(-60.0, RotorSample(0.4, 24.0, 60.0)) == ""
    assert check.add(-60.0, RotorSample(0.41, 24.1, -20.0)) == ""


def test_a_rotor_that_runs_away_is_noticed():
    rotor = Rotor(0.02)
    rotor.run(1.0)
    after, said = rotor.run(1.0, seen=lambda s: RotorSample(s.time_s, s.angle, 400.0))
    assert "runs away: 400 rad/s" in said
    assert after <= 0.05


def test_a_rotor_at_rest_says_nothing():
    rotor = Rotor(0.02)
    assert rotor.run(3.0, lambda _: 0.0, lambda s: RotorSample(s.time_s, 1.0, 0.0)) == (None, "")


def test_over_a_stall_of_the_computer_nothing_is_judged():
    rotor = Rotor(0.02)
    rotor.run(0.5)
    rotor.t += 0.5
    assert rotor.run(0.3)[1] == ""
