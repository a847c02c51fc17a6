# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When a lost device is tried again."""

import itertools

import pytest

from fish_hw.devices.reconnect import Link, Loss


def failed_attempts(link: Link, start: float, duration_s: float) -> list[float]:
    """Times at which a device that stays away is tried, looked at every 10 ms."""
    times = []
    for i in range(round(duration_s / 0.01)):
        now = start + 0.01 * i
        if link.due(now):
            times.append(now)
            link.lose("gone", now)
    return times


def waits(times: list[float]) -> list[float]:
    return [b - a for a, b in itertools.pairwise(times)]


def test_waits_double_up_to_the_longest_and_start_again_after_data() -> None:
    link = Link("device")
    first = failed_attempts(link, 100.0, 25.0)
    assert first[0] == 100.0  # at once
    assert waits(first) == pytest.approx([0.5, 1.0, 2.0, 4.0, 5.0, 5.0, 5.0], abs=0.011)
    assert link.attempts == len(first)
    link.works()
    assert waits(failed_attempts(link, 200.0, 4.0)) == pytest.approx([0.5, 1.0, 2.0], abs=0.011)


def test_a_reason_is_said_when_it_is_new_and_the_return_once() -> None:
    link = Link("device")
    assert link.works() == []  # it was never away
    events = [*link.lose("gone", 0.0), *link.lose("gone", 1.0), *link.lose("busy", 2.0)]
    assert events == ["gone", "busy"]
    assert all(isinstance(event, Loss) for event in events)
    assert link.trouble == "busy"
    assert [*link.works(), *link.works()] == ["device connected again"]
    assert link.lose("busy", 3.0) == ["busy"]  # a second loss is news though its reason is not
