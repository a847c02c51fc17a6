# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A thread that repeats one step at a fixed rate: rclpy timers above 30 Hz are dear on a small computer."""

import threading
import time
from collections.abc import Callable

SHORTEST_WAIT_S = 5e-4  # of a clock that stands still


class Worker:
    """Calls step() every period_s until stop(); calls on_failure() if a step raises.

    Args:
        step: what is repeated.
        period_s: s of the clock.
        on_failure: called after an error, which ends the thread.
        clock: s; never set back.
        wall: how long [s] to wait for a duration of the clock, before it is looked at again.
    """

    def __init__(
        self,
        step: Callable[[], None],
        period_s: float,
        on_failure: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[float], float] = lambda duration_s: duration_s,
    ) -> None:
        self._step = step
        self._period_s = period_s
        self._on_failure = on_failure
        self._clock, self._wall = clock, wall
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="device", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Ask for the end and wait for it; a signal may have come before the thread was started."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        due = self._clock()
        finished = False
        try:
            while not self._stop.is_set():
                self._step()
                due = self._wait(due + self._period_s)
            finished = True
        finally:
            if not finished:
                self._on_failure()

    def _wait(self, due: float) -> float:
        """Wait for a moment [s]; when it was: a short delay is made up for, a long one is not."""
        now = self._clock()
        if due < now - self._period_s:
            return now
        while due > now and not self._stop.is_set():
            self._stop.wait(max(self._wall(due - now), SHORTEST_WAIT_S))
            now = self._clock()
        return due
