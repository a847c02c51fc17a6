# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Simulated time between messages on a made-up wall clock."""

import itertools

import pytest

from fish_node.simulated_time import LOOK_S, SimulatedTime

DT = 0.01


class Wall:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def ticked(rate: float, count: int = 30) -> tuple[SimulatedTime, Wall]:
    """A time that has heard a message for every period, at a rate; the last one said count * DT."""
    wall = Wall()
    time = SimulatedTime(wall)
    for k in range(count + 1):
        time.tick(DT * k)
        wall.now += DT / rate
    wall.now -= DT / rate
    return time, wall


def test_it_does_not_run_before_the_first_message():
    wall = Wall()
    time = SimulatedTime(wall)
    wall.now += 5.0
    assert not time.runs
    assert time.now() == 0.0


@pytest.mark.parametrize("rate", [0.1, 0.5, 1.0, 3.0])
def test_it_runs_on_at_the_rate_of_the_messages(rate):
    time, wall = ticked(rate)
    assert time.now() == pytest.approx(30 * DT)
    wall.now += 0.4 * DT / rate
    assert time.now() == pytest.approx(30.4 * DT)


def test_it_waits_for_the_next_message():
    time, wall = ticked(0.2)
    wall.now += 100.0
    assert time.now() == pytest.approx(31 * DT)


def test_two_that_hear_a_message_at_different_moments_differ_by_the_delay_times_the_rate():
    early, wall = ticked(0.2)
    late, _ = ticked(0.2)
    late._wall = wall  # one computer
    early.tick(31 * DT)
    wall.now += 0.004
    late.tick(31 * DT)
    assert early.now() - late.now() == pytest.approx(0.2 * 0.004)


def test_it_never_goes_back_while_the_messages_do_not():
    time, wall = ticked(0.3)
    seen = []
    for k, delay in enumerate([0.0, 0.1, 0.002, 0.5, 0.03, 0.0, 0.04]):
        for _ in range(5):
            wall.now += delay / 5
            seen.append(time.now())
        time.tick((31 + k) * DT)
        seen.append(time.now())
        time.tick((31 + k) * DT)  # said again
        seen.append(time.now())
    assert all(after >= before for before, after in itertools.pairwise(seen))


def test_one_standstill_does_not_make_it_slow():
    time, wall = ticked(0.25)
    wall.now += 60.0
    time.tick(31 * DT)
    wall.now += 0.5 * DT / 0.25
    assert time.now() == pytest.approx(31.5 * DT)


def test_a_simulation_that_begins_anew_is_followed():
    time, wall = ticked(0.5)
    time.tick(0.0)
    assert time.now() == 0.0
    wall.now += 0.02
    time.tick(DT)
    wall.now += 0.01
    assert time.now() == pytest.approx(1.5 * DT)


def test_who_waits_looks_again_soon_however_slow_the_simulation_is():
    time, _ = ticked(0.5)
    assert time.wall(0.002) == pytest.approx(0.004)
    assert time.wall(10.0) == LOOK_S
