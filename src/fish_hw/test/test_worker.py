# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The device's thread on a clock that others move."""

import threading

from fish_hw.nodes.worker import Worker

PERIOD_S, TIMEOUT_S = 0.01, 15.0


def test_steps_come_by_the_clock_that_it_is_given_and_not_by_the_wall_clocks():
    now = [0.0]
    stepped = threading.Semaphore(0)
    times: list[float] = []

    def step() -> None:
        times.append(now[0])
        stepped.release()

    worker = Worker(step, PERIOD_S, lambda: None, lambda: now[0], lambda _: 1e-3)
    worker.start()
    for k in range(1, 11):
        assert stepped.acquire(timeout=TIMEOUT_S)
        now[0] = k * PERIOD_S + 1e-6
    assert stepped.acquire(timeout=TIMEOUT_S)
    assert not stepped.acquire(timeout=0.1)  # the clock stands still
    worker.stop(TIMEOUT_S)
    assert len(times) == 11
    assert all(abs(time - k * PERIOD_S) < 1e-3 for k, time in enumerate(times))
