# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rotor's limits and its way to a stop, on simulated time."""

import itertools
import math
from dataclasses import replace

import pytest

from fish_hw.devices.rotor_guard import Phase, RotorGuard
from fish_hw.settings import RotorSettings

SETTINGS = RotorSettings()
DT = 0.01
AMPLITUDE, FREQUENCY = 9.0, 2.0 * math.tau  # rad, rad/s: 2 Hz
BOTH_WAYS = pytest.mark.parametrize("direction", [1.0, -1.0], ids=["left", "right"])


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
