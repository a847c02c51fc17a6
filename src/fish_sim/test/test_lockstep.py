# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Waiting for the loop on made-up clocks."""

from fish_sim.model import DT
from fish_sim.nodes.pacing import LOOSEN, Lockstep


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
