"""The rotor's watchdog, limits and latch, on simulated time."""

import itertools
import math
from dataclasses import replace

import pytest

from fish_hw.devices.rotor_guard import AT_REST, Phase, RotorGuard
from fish_hw.settings.rotor import RotorSettings

SETTINGS = RotorSettings(resume="auto")
DT = 0.01
AMPLITUDE, FREQUENCY = 9.0, 2.0 * math.tau / 1.0  # rad, rad/s: 2 Hz
BOTH_WAYS = pytest.mark.parametrize("direction", [1.0, -1.0], ids=["left", "right"])


def oscillation(t: float) -> float:
    return AMPLITUDE * FREQUENCY * math.sin(FREQUENCY * t)


class Bench:
    """Steps a guard at 100 Hz and keeps what it did."""

    def __init__(self, settings: RotorSettings = SETTINGS) -> None:
        self.guard = RotorGuard(settings)
        self.now = 100.0
        self.actions = []

    def run(self, duration_s: float, command=None) -> list:
        new = []
        for i in range(round(duration_s / DT)):
            if command is not None:
                self.guard.command(command(i * DT), self.now)
            new.append(self.guard.step(self.now))
            self.now += DT
        self.actions += new
        return new


def test_follows_the_paper_oscillation_unchanged():
    actions = Bench().run(1.0, oscillation)
    sent = [a.velocity for a in actions]
    wanted = [oscillation(i * DT) for i in range(len(sent))]
    assert max(abs(a - b) for a, b in zip(sent, wanted, strict=True)) < 1e-9
    assert all(a.ask for a in actions)  # measured in every cycle


@BOTH_WAYS
def test_speed_and_acceleration_are_limited(direction):
    bench = Bench(replace(SETTINGS, max_velocity=50.0, max_acceleration=500.0))
    sent = [direction * a.velocity for a in bench.run(0.5, lambda _: direction * 200.0)]
    assert max(sent) == 50.0
    assert max(b - a for a, b in itertools.pairwise(sent)) <= 500.0 * DT + 1e-9
    assert bench.guard.clamped == 50


def test_the_first_cycle_starts_from_rest():
    guard = RotorGuard(SETTINGS)
    guard.command(150.0, 100.0)
    assert guard.step(100.0).velocity == 0.0


@BOTH_WAYS
def test_stale_command_ramps_down_then_coasts_then_is_silent(direction):
    bench = Bench()
    bench.run(0.5, lambda _: direction * 100.0)
    after = bench.run(1.5)
    speeds = [direction * a.velocity for a in after if a.velocity is not None]
    held = [v for v in speeds if v == 100.0]
    assert len(held) * DT == pytest.approx(SETTINGS.stale_s, abs=2 * DT)
    ramp = speeds[len(held) :]
    assert all(b < a for a, b in itertools.pairwise(ramp))
    assert len(ramp) * DT == pytest.approx(SETTINGS.ramp_s, abs=2 * DT)
    coast = next(i for i, a in enumerate(after) if a.coast)
    quiet = [a for a in after[coast + 1 :] if not (a.ask or a.coast or a.velocity is not None)]
    assert len(quiet) * DT > SETTINGS.module_timeout_s  # the module's own watchdog can fire
    assert not any(
        a.ask for a in after[len(held) : coast]
    )  # no polling from the moment it is stale
    assert after[-1].ask
    assert after[-1].velocity is None
    assert bench.guard.phase is Phase.RESTING
    assert "no command for 0.15 s" in bench.guard.reason


@BOTH_WAYS
def test_ramp_respects_the_acceleration_limit(direction):
    bench = Bench(replace(SETTINGS, ramp_s=0.0, max_acceleration=500.0))
    bench.run(1.0, lambda _: direction * 100.0)
    speeds = [direction * a.velocity for a in bench.run(0.6) if a.velocity is not None]
    assert len(speeds) > 30  # 0.15 s until it is stale, 0.2 s for the ramp
    assert max(a - b for a, b in itertools.pairwise(speeds)) <= 500.0 * DT + 1e-9


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_bad_numbers_do_not_feed_the_watchdog(bad):
    bench = Bench()
    bench.run(0.2, lambda _: 50.0)
    bench.run(1.0, lambda _: bad)
    assert bench.guard.phase is not Phase.RUNNING
    assert bench.guard.rejected == 100


def test_resume_zero_needs_rest_not_a_zero_crossing():
    bench = Bench(replace(SETTINGS, resume="zero"))
    assert all(a.velocity is None for a in bench.run(3.0, oscillation))  # crosses zero 12 times
    bench.run(0.35, lambda _: 0.0)
    assert bench.run(0.1, oscillation)[-1].velocity is not None


@BOTH_WAYS
def test_a_steady_speed_is_no_rest(direction):
    bench = Bench(replace(SETTINGS, resume="zero"))
    assert all(a.velocity is None for a in bench.run(1.0, lambda _: direction * 100.0))


def test_a_stop_asks_for_a_new_rest():
    """Commands that rested before the stop say nothing of what their sender knows of it."""
    bench = Bench(replace(SETTINGS, resume="zero"))
    bench.run(1.0, lambda _: 0.0)
    assert not bench.guard.latched
    bench.guard.step(bench.now, ("battery",))
    bench.run(SETTINGS.rearm_s - 2 * DT, lambda _: 0.0)
    assert bench.guard.latched
    bench.run(4 * DT, lambda _: 0.0)
    assert (bench.guard.latched, bench.guard.reason) == (False, "")


def test_resume_zero_after_a_stop():
    bench = Bench(replace(SETTINGS, resume="zero"))
    bench.run(0.5, lambda _: 0.0)
    bench.run(0.5, oscillation)
    bench.run(1.0)
    assert all(a.velocity is None for a in bench.run(1.0, oscillation))
    bench.run(0.35, lambda _: AT_REST / 2)
    assert bench.run(0.1, oscillation)[-1].velocity is not None


def test_rest_with_gaps_is_no_rest():
    bench = Bench(replace(SETTINGS, resume="zero"))
    for _ in range(5):
        bench.run(0.1, lambda _: 0.0)
        bench.run(0.3)
    assert all(a.velocity is None for a in bench.actions)


@pytest.mark.parametrize(("resume", "reason"), [("auto", ""), ("zero", "not enabled yet")])
def test_reason_at_the_start(resume, reason):
    bench = Bench(replace(SETTINGS, resume=resume))
    bench.run(0.1)
    assert (bench.guard.latched, bench.guard.reason) == (bool(reason), reason)


def test_resume_manual_needs_the_operator():
    bench = Bench(replace(SETTINGS, resume="manual"))
    assert all(a.velocity is None for a in bench.run(1.0, lambda _: 0.0))
    bench.guard.enable()
    assert bench.run(0.1, oscillation)[-1].velocity is not None


@pytest.mark.parametrize("resume", ["auto", "zero", "manual"])
def test_operator_stop_holds_whatever_the_setting(resume):
    bench = Bench(replace(SETTINGS, resume=resume))
    bench.guard.enable()
    bench.run(0.5, lambda _: 0.0)
    bench.guard.stop("stopped by the operator", hold=True)
    bench.run(2.0, lambda _: 0.0)
    assert bench.guard.latched
    assert bench.guard.reason == "stopped by the operator"
    bench.guard.enable()
    assert bench.run(0.1, oscillation)[-1].velocity is not None


def test_resume_auto_goes_on_after_the_stop_is_complete():
    bench = Bench()
    bench.run(0.5, lambda _: 100.0)
    bench.run(0.3)
    actions = bench.run(1.5, lambda _: 100.0)
    assert any(a.coast for a in actions)
    assert actions[-1].velocity == 100.0
    first = next(
        a.velocity
        for a in actions[actions.index(next(a for a in actions if a.coast)) :]
        if a.velocity
    )
    assert first <= SETTINGS.max_acceleration * DT + 1e-9  # from rest again, no jump


@pytest.mark.parametrize("resume", ["auto", "zero"])
def test_no_resuming_while_there_is_an_obstacle(resume):
    bench = Bench(replace(SETTINGS, resume=resume))
    bench.guard.enable()
    bench.run(0.5, lambda _: 0.0)
    bench.run(0.5, lambda _: 100.0)
    driven = []
    for i in range(300):
        bench.guard.command(0.0 if i > 100 else 100.0, bench.now)
        action = bench.guard.step(bench.now, ("battery",))
        driven.append(action.velocity)
        bench.now += DT
    assert driven[0] < 100.0  # the ramp begins at once
    assert all(v is None for v in driven[30:])
    assert (bench.guard.latched, bench.guard.reason) == (True, "battery")
    bench.run(0.4, lambda _: 0.0)
    assert bench.run(0.1, oscillation)[-1].velocity is not None


def test_cut_is_silent_at_once_and_latches():
    bench = Bench(replace(SETTINGS, resume="zero"))
    bench.run(0.5, lambda _: 0.0)
    bench.run(0.2, lambda _: 100.0)
    bench.guard.cut("the module restarted", bench.now)
    quiet = bench.run(0.3, lambda _: 100.0)
    assert not any(a.velocity is not None or a.ask or a.coast for a in quiet)
    assert all(a.velocity is None for a in bench.run(1.0, lambda _: 100.0))
    assert (bench.guard.latched, bench.guard.reason) == (True, "the module restarted")


def test_a_late_cycle_earns_no_jump():
    bench = Bench()
    bench.run(0.1, lambda _: 0.0)
    bench.now += 5.0
    bench.guard.command(150.0, bench.now)
    assert bench.guard.step(bench.now).velocity <= SETTINGS.max_acceleration * 0.05 + 1e-9
