# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Simulated time: in lockstep with nodes, and paced by the wall clock."""

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.nodes.pacing import LOOSEN, MAX_LAG, Lockstep, Pacer


def test_nobody_is_waited_for_before_the_first_word():
    assert Lockstep(1.0).may_advance(100.0, 0.0)


def test_time_stands_until_the_last_one_has_answered():
    lockstep = Lockstep(1.0)
    lockstep.answered("fusion", 1.0)
    lockstep.answered("controller", 1.0)
    assert lockstep.may_advance(1.0, 0.0)
    assert not lockstep.may_advance(1.0 + DT, 0.1)
    lockstep.answered("fusion", 1.0 + DT)
    assert not lockstep.may_advance(1.0 + DT, 0.2)
    lockstep.answered("controller", 1.0 + DT)
    assert lockstep.may_advance(1.0 + DT, 0.3)


def test_who_answers_to_every_period_is_waited_for_in_every_period():
    lockstep = Lockstep(60.0)
    lockstep.answered("exciter", 0.0)
    for k in range(1, 20):
        assert not lockstep.may_advance(DT * k, 100.0 * k)
        assert not lockstep.may_advance(DT * k, 100.0 * k + LOOSEN)
        lockstep.answered("exciter", DT * k)
        assert lockstep.may_advance(DT * k, 100.0 * k + LOOSEN)


def test_who_answers_to_every_second_period_shows_it_once():
    lockstep = Lockstep(60.0)
    lockstep.answered("fusion", 0.0)
    assert not lockstep.may_advance(DT, 0.0)
    assert lockstep.may_advance(DT, 1.1 * LOOSEN)
    for k in range(2, 20, 2):
        lockstep.answered("fusion", DT * k)
        assert all(lockstep.may_advance(DT * (k + ahead), 10.0) for ahead in range(2))
        assert not lockstep.may_advance(DT * (k + 2), 10.0)


def test_an_answer_that_is_left_out_once_loosens_nothing():
    """Who leaves out one period and is then slow would be left behind by a period each time."""
    lockstep = Lockstep(60.0)
    for k in (0, 1, 3):
        lockstep.answered("exciter", DT * k)
    assert lockstep.may_advance(DT * 3, 0.0)
    assert not lockstep.may_advance(DT * 4, 0.0)


def test_a_long_silence_is_forgiven_with_the_next_two_answers():
    lockstep = Lockstep(60.0)
    lockstep.answered("exciter", 0.0)
    assert not lockstep.may_advance(DT, 0.0)
    assert lockstep.may_advance(DT, 1.1 * LOOSEN)
    for k in (2, 3):
        lockstep.answered("exciter", DT * k)
    assert not lockstep.may_advance(DT * 4, 10.0)


def test_how_long_time_has_stood_is_known():
    lockstep = Lockstep(5.0)
    lockstep.answered("exciter", 0.0)
    assert lockstep.waited(9.0) == 0.0
    assert not lockstep.may_advance(1.0, 10.0)
    assert lockstep.waited(12.5) == 2.5
    lockstep.answered("exciter", 1.0)
    assert lockstep.may_advance(1.0, 13.0)
    assert lockstep.waited(13.0) == 0.0


def test_the_silent_is_given_up_after_the_patience_until_heard_again():
    lockstep = Lockstep(1.0)
    lockstep.answered("controller", 0.0)
    assert not lockstep.may_advance(1.0, 10.0)
    assert not lockstep.may_advance(1.0, 10.9)
    assert lockstep.may_advance(1.0, 11.1)
    assert lockstep.may_advance(5.0, 11.2)
    lockstep.answered("controller", 5.0)
    assert lockstep.may_advance(5.0, 11.3)
    assert not lockstep.may_advance(6.0, 11.4)


def test_who_was_given_up_and_speaks_late_is_not_waited_for_at_every_word():
    lockstep = Lockstep(1.0)
    lockstep.answered("fusion", 0.0)
    assert not lockstep.may_advance(1.0, 10.0)
    assert lockstep.may_advance(1.0, 11.1)
    for k in range(1, 5):
        assert lockstep.may_advance(1.0 + k, 11.1 + k)
        lockstep.answered("fusion", 1.0 + k - 0.1)
        assert lockstep.may_advance(1.5 + k, 11.5 + k)
    lockstep.answered("fusion", 5.5)
    assert not lockstep.may_advance(5.6, 20.0)


def test_every_wait_has_the_whole_patience():
    lockstep = Lockstep(1.0)
    lockstep.answered("controller", 0.0)
    for k in range(1, 5):
        assert not lockstep.may_advance(float(k), 0.9 * k)
        lockstep.answered("controller", float(k))
        assert lockstep.may_advance(float(k), 0.9 * k + 0.1)


def test_patience_0_waits_for_nobody():
    lockstep = Lockstep(0.0)
    lockstep.answered("controller", 0.0)
    assert lockstep.may_advance(100.0, 0.0)


def test_with_slack_a_few_periods_are_no_reason_to_wait():
    lockstep = Lockstep(5.0, slack=3.5 * DT)
    for k in range(20):
        lockstep.answered("rotor driver", DT * k)
        assert all(lockstep.may_advance(DT * (k + behind), 0.1 * k) for behind in range(4))
        assert not lockstep.may_advance(DT * (k + 4), 0.1 * k)


def test_it_says_who_is_waited_for():
    lockstep = Lockstep(5.0)
    lockstep.answered("fusion", 1.0)
    lockstep.answered("tracker", 0.0)
    assert lockstep.awaited == ""
    assert not lockstep.may_advance(1.0, 0.0)
    assert lockstep.awaited == "tracker"
    lockstep.answered("tracker", 1.0)
    assert lockstep.may_advance(1.0, 0.1)
    assert lockstep.awaited == ""


def run(factor, times):
    pacer = Pacer(factor, 0.01, 100.0)
    return [pacer.due(100.0 + t) for t in times], pacer


@pytest.mark.parametrize(("factor", "expected"), [(1.0, 100), (0.5, 50), (3.0, 300)])
def test_periods_follow_real_time_at_the_factor(factor, expected):
    counts, pacer = run(factor, [0.001 * k for k in range(1, 1001)])
    assert sum(counts) == expected
    assert max(counts) == 1
    assert pacer.lost == 0.0


def test_a_jittering_timer_neither_loses_nor_adds_periods():
    """A timer is late now and then, never early."""
    counts, pacer = run(1.0, [0.01 * k + (0.008 if k % 2 else 1e-5) for k in range(1, 101)])
    assert counts == [1] * 100
    assert pacer.lost == 0.0


@pytest.mark.parametrize("factor", [1.0, 0.5, 3.0])
def test_simulated_time_is_never_ahead_of_real_time(factor):
    """Stamps from the future look like a clock that is wrong: recordings would be moved by it."""
    random, pacer = np.random.default_rng(0), Pacer(factor, 0.01, 100.0)
    done, now = 0, 100.0
    for _ in range(1000):
        now += random.exponential(0.01)
        done += pacer.due(now)
        assert 0.01 * done <= (now - 100.0) * factor + 1e-7
    assert 0.01 * done > (now - 100.0) * factor - 0.02


def test_a_short_lag_is_caught_up_with():
    counts, pacer = run(1.0, [0.01, 0.11, 0.12])
    assert counts == [1, 10, 1]
    assert pacer.lost == 0.0


def test_a_long_lag_is_given_up_and_counted():
    counts, pacer = run(1.0, [0.01, 3.01, 3.02, 3.03])
    assert counts == [1, 0, 1, 1]
    assert pacer.lost == pytest.approx(3.0)
    assert MAX_LAG < 3.0


def test_what_is_given_up_is_counted_in_real_time():
    counts, pacer = run(3.0, [0.01, 1.01, 1.02])
    assert counts == [3, 0, 3]
    assert pacer.lost == pytest.approx(1.0)


def test_after_a_long_lag_simulated_time_goes_on_from_now():
    pacer = Pacer(1.0, 0.01, 100.0)
    assert pacer.due(103.0) == 0
    assert pacer.due(103.009) == 0
    assert pacer.due(103.0101) == 1


def test_factor_0_is_as_fast_as_possible():
    counts, _ = run(0.0, [0.0, 0.0, 1e-6, 100.0])
    assert counts == [1, 1, 1, 1]
