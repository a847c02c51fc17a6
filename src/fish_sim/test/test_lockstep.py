"""Waiting for the loop on made-up clocks."""

import pytest

from fish_sim.model import DT
from fish_sim.nodes.lockstep import AHEAD, Lockstep


def test_nobody_is_waited_for_before_the_first_word():
    assert Lockstep(1.0).may_advance(100.0, 0.0)


def test_time_stands_until_the_last_one_has_answered():
    lockstep = Lockstep(1.0)
    lockstep.answered("fusion", 1.0)
    lockstep.answered("controller", 1.0)
    assert lockstep.may_advance(1.0 + 0.5 * AHEAD, 0.0)
    assert not lockstep.may_advance(1.0 + 2.0 * AHEAD, 0.1)
    lockstep.answered("fusion", 1.0 + 2.0 * AHEAD)
    assert not lockstep.may_advance(1.0 + 2.0 * AHEAD, 0.2)
    lockstep.answered("controller", 1.0 + 1.5 * AHEAD)
    assert lockstep.may_advance(1.0 + 2.0 * AHEAD, 0.3)


@pytest.mark.parametrize("every", [1, 2])
def test_who_answers_to_every_so_many_periods_is_waited_for_in_each_of_these(every):
    lockstep = Lockstep(1.0)
    lockstep.answered("exciter", 0.0)
    for k in range(every, 20, every):
        lockstep.answered("exciter", DT * k)
        assert all(lockstep.may_advance(DT * (k + ahead), 0.0) for ahead in range(every))
        assert not lockstep.may_advance(DT * (k + every), 0.0)


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
