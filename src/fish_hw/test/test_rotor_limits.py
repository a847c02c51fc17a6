# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rotor's limits and its way to a stop; battery, temperature and fault limits; jam, stuck encoder and runaway are told from
a rotor that lags. All on simulated time.
"""

import itertools
import math
from dataclasses import replace

import pytest

from fish_hw.devices.rotor_guard import Phase, RotorGuard
from fish_hw.devices.rotor_watch import MotionCheck, RotorHealth
from fish_hw.devices.vertiq import RotorSample, RotorTelemetry
from fish_hw.settings import RotorSettings

SETTINGS = RotorSettings()  # 4 cells, warn 3.5, stop 3.3 V
DT = 0.01
AMPLITUDE, FREQUENCY = 9.0, 2.0 * math.tau  # rad, rad/s: 2 Hz
BOTH_WAYS = pytest.mark.parametrize("direction", [1.0, -1.0], ids=["left", "right"])

WELL = RotorTelemetry(35.0, 40.0, 15.6, 0.5, 10.0, 0, 1.0, 1)


def oscillation(t: float) -> float:
    return AMPLITUDE * FREQUENCY * math.sin(FREQUENCY * t)


class Bench:
    """Steps a guard at 100 Hz and keeps what it did."""

    def __init__(self, settings: RotorSettings = SETTINGS) -> None:
        self.guard = RotorGuard(settings)
        self.now = 100.0

    def run(self, duration_s: float, command=None, armed: bool = True, dt: float = DT) -> list:
        actions = []
        for i in range(round(duration_s / dt)):
            if command is not None:
                self.guard.command(command(i * dt))
            actions.append(self.guard.step(self.now, armed))
            self.now += dt
        return actions


def test_after_a_stall_in_which_the_module_coasted_the_speed_starts_from_rest():
    guard = RotorGuard(RotorSettings())
    guard.command(100.0)
    now = 0.0
    while guard.step(now, armed=True).velocity != 100.0:
        now += 0.01
    kept = guard.step(now + 0.2, armed=True).velocity
    assert kept == 100.0
    again = guard.step(now + 0.2 + 0.3, armed=True).velocity
    assert again is not None
    assert 0.0 < again <= 2200.0 * 0.015


def test_follows_the_paper_oscillation_unchanged():
    actions = Bench().run(1.0, oscillation)
    sent = [a.velocity for a in actions]
    wanted = [oscillation(i * DT) for i in range(len(sent))]
    assert max(abs(a - b) for a, b in zip(sent, wanted, strict=True)) < 1e-9
    assert all(a.ask for a in actions)  # measured in every cycle


def test_nothing_moves_while_disarmed():
    actions = Bench().run(3.0, oscillation, armed=False)
    assert all(a.velocity is None and a.ask for a in actions)


@BOTH_WAYS
def test_speed_and_acceleration_are_limited(direction):
    bench = Bench(replace(SETTINGS, max_velocity=50.0, max_acceleration=500.0))
    sent = [direction * a.velocity for a in bench.run(0.5, lambda _: direction * 200.0)]
    assert max(sent) == 50.0
    assert max(b - a for a, b in itertools.pairwise(sent)) <= 500.0 * DT + 1e-9
    assert bench.guard.clamped == 50


def test_the_first_cycle_starts_from_rest():
    guard = RotorGuard(SETTINGS)
    guard.command(150.0)
    assert guard.step(100.0, True).velocity == 0.0


@BOTH_WAYS
def test_a_disarmed_rotor_ramps_down_then_coasts_then_is_silent(direction):
    bench = Bench()
    bench.run(0.5, lambda _: direction * 100.0)
    after = bench.run(1.5, lambda _: direction * 100.0, armed=False)
    speeds = [direction * a.velocity for a in after if a.velocity is not None]
    assert speeds[0] < 100.0  # at once
    assert all(b < a for a, b in itertools.pairwise(speeds))
    assert len(speeds) * DT == pytest.approx(SETTINGS.ramp_s, abs=2 * DT)
    coast = next(i for i, a in enumerate(after) if a.coast)
    quiet = [a for a in after[coast + 1 :] if not (a.ask or a.coast or a.velocity is not None)]
    assert len(quiet) * DT > SETTINGS.module_timeout_s  # the module's own watchdog can fire
    assert not any(a.ask for a in after[:coast])  # no polling from the moment it is disarmed
    assert after[-1].ask
    assert after[-1].velocity is None
    assert bench.guard.phase is Phase.RESTING


@BOTH_WAYS
def test_ramp_respects_the_acceleration_limit(direction):
    bench = Bench(replace(SETTINGS, ramp_s=0.0, max_acceleration=500.0))
    bench.run(1.0, lambda _: direction * 100.0)
    stopping = bench.run(0.6, armed=False)
    speeds = [direction * a.velocity for a in stopping if a.velocity is not None]
    assert len(speeds) == pytest.approx(20, abs=1)  # 100 rad/s at 500 rad/s^2
    assert max(a - b for a, b in itertools.pairwise(speeds)) <= 500.0 * DT + 1e-9


def test_late_cycles_do_not_make_the_ramp_longer():
    bench = Bench()
    bench.run(0.5, lambda _: 100.0)
    begin = bench.now
    bench.run(0.4, armed=False, dt=0.04)
    assert bench.guard.phase is not Phase.STOPPING
    late = Bench()
    late.run(0.5, lambda _: 100.0)
    speeds = [a.velocity for a in late.run(0.4, armed=False, dt=0.04) if a.velocity is not None]
    assert len(speeds) * 0.04 <= SETTINGS.ramp_s + 0.04
    assert bench.now - begin == pytest.approx(0.4)


def test_arming_again_during_a_stop_goes_on_from_rest_after_it():
    bench = Bench()
    bench.run(0.5, lambda _: 100.0)
    bench.run(0.05, lambda _: 100.0, armed=False)
    actions = bench.run(1.5, lambda _: 100.0)
    coast = next(i for i, a in enumerate(actions) if a.coast)
    first = next(a.velocity for a in actions[coast:] if a.velocity)
    assert first <= SETTINGS.max_acceleration * DT + 1e-9
    assert actions[-1].velocity == 100.0


def test_cut_is_silent_at_once_and_starts_again_from_rest():
    bench = Bench()
    bench.run(0.2, lambda _: 100.0)
    bench.guard.cut(bench.now)
    quiet = bench.run(0.3, lambda _: 100.0)
    assert not any(a.velocity is not None or a.ask or a.coast for a in quiet)
    driven = [a.velocity for a in bench.run(0.5, lambda _: 100.0) if a.velocity is not None]
    assert driven[0] <= SETTINGS.max_acceleration * DT + 1e-9


@pytest.mark.parametrize("late_s", [0.03, 5.0])
def test_a_late_cycle_earns_no_jump(late_s):
    bench = Bench()
    bench.run(0.1, lambda _: 0.0)
    bench.now += late_s
    bench.guard.command(150.0)
    jump = bench.guard.step(bench.now, True).velocity
    assert jump <= SETTINGS.max_acceleration * 1.5 * DT + 1e-9


@pytest.mark.parametrize("back_s", [0.005, 1000.0])
def test_a_clock_that_goes_back_changes_no_speed(back_s):
    bench = Bench()
    bench.run(0.5, lambda _: 100.0)
    assert bench.guard.step(bench.now - back_s, True).velocity == 100.0


def test_well():
    health = RotorHealth(SETTINGS).judge(WELL, 0.0)
    assert (health.warnings, health.stops) == ((), ())


def test_battery_filter_is_a_first_order_lag():
    health = RotorHealth(SETTINGS)
    health.judge(WELL, 0.0)
    for i in range(1, 5):
        health.judge(replace(WELL, volts=12.6), SETTINGS.battery_filter_s / 4 * i)
    # one time constant after a step the rest is 1/e
    assert health.filtered_volts == pytest.approx(12.6 + (15.6 - 12.6) * 0.36788, abs=1e-3)


def test_sag_under_load_does_not_stop_but_an_empty_battery_does():
    health = RotorHealth(SETTINGS)
    health.judge(WELL, 0.0)
    for i in range(100):  # 4 Hz ripple of 2 V, asked at 10 Hz
        ripple = replace(WELL, volts=14.6 + math.sin(math.tau * 4.0 * 0.1 * i))
        assert not health.judge(ripple, 0.1 * i).stops
    stops = [health.judge(replace(WELL, volts=12.8), 10.0 + 0.1 * i).stops for i in range(30)]
    assert stops[-1] == ("battery at 3.20 V per cell",)
    assert next(i for i, stop in enumerate(stops) if stop) * 0.1 < 1.0


def test_a_peak_of_voltage_warns_and_a_high_battery_stops():
    health = RotorHealth(SETTINGS)
    assert not health.judge(replace(WELL, volts=4 * 4.4), 0.0).stops
    assert not health.judge(WELL, 0.1).stops
    assert not health.judge(replace(WELL, volts=4 * 4.4), 0.2).stops
    said = health.judge(replace(WELL, volts=4 * 4.4), 0.3).stops
    assert said == ("battery driven up to 4.40 V per cell",)


def test_battery_must_recover_above_the_warning():
    health = RotorHealth(replace(SETTINGS, battery_filter_s=0.0))
    assert health.judge(replace(WELL, volts=4 * 3.25), 0.0).stops
    assert health.judge(replace(WELL, volts=4 * 3.45), 1.0).stops  # relieved of the load
    assert not health.judge(replace(WELL, volts=4 * 3.55), 2.0).stops


def test_missing_answers_leave_the_judgement_as_it_was():
    health = RotorHealth(replace(SETTINGS, battery_filter_s=0.0))
    stopped = health.judge(replace(WELL, volts=4 * 3.2, coil_c=90.0), 0.0).stops
    assert len(stopped) == 2
    assert health.judge(RotorTelemetry(), 1.0).stops == stopped
    assert health.judge(RotorTelemetry(faults=0b10), 2.0).stops == (
        *stopped,
        "module faults: input voltage",
    )
    assert RotorHealth(SETTINGS).judge(RotorTelemetry(faults=0), 0.0).stops == ()


@pytest.mark.parametrize(
    ("change", "warning", "stop"),
    [
        ({"volts": 4 * 3.4}, "battery at 3.40 V", ""),
        ({"volts": 4 * 4.4}, "driven up to 4.40 V", ""),
        ({"coil_c": 75.0}, "coil at 75", ""),
        ({"controller_c": 90.0}, "", "controller at 90"),
        ({"derate": 0.6}, "60% of its power", ""),
        ({"faults": 0b1000001}, "", "logic supply low, coil temperature"),
    ],
)
def test_limits(change, warning, stop):
    health = RotorHealth(SETTINGS).judge(replace(WELL, **change), 0.0)
    assert warning in "".join(health.warnings)
    assert bool(warning) == bool(health.warnings)
    assert stop in "".join(health.stops)
    assert bool(stop) == bool(health.stops)


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


@pytest.mark.parametrize("period_s", [0.05, 0.06])
def test_a_jam_is_noticed_with_seldom_samples(period_s):
    check, seen = MotionCheck(), []
    for k in range(40):
        seen.append(check.add(oscillation(k * period_s), RotorSample(k * period_s, 0.0, 0.0)))
    assert "jammed" in next(filter(None, seen)) or "stuck" in next(filter(None, seen))


def test_samples_too_seldom_to_see_a_jam_stop_the_rotor():
    check, seen = MotionCheck(), []
    for k in range(40):
        t = 0.08 * k
        seen.append(check.add(60.0, RotorSample(t, 60.0 * t, 60.0)))
    assert "nobody can see a jam: measured speed comes every 0.080 s" in next(filter(None, seen))


def test_a_rotor_that_runs_away_between_seldom_samples_is_noticed():
    check = MotionCheck()
    check.add(60.0, RotorSample(0.0, 0.0, 60.0))
    assert "runs away: 400 rad/s" in check.add(60.0, RotorSample(0.08, 30.0, 400.0))
