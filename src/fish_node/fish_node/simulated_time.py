# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Simulated time between two messages on /clock, for threads that do not wait for the next one.

The time of /clock alone stands still for a whole step of the simulation. Two processes that hear it at slightly different
moments then disagree by a step. Here time runs on between the messages, at the rate at which they come, and two processes
disagree by the difference in delivery times this rate.
"""

import time
from collections import deque
from collections.abc import Callable
from statistics import median

REMEMBERED = 20  # steps, of whose rates the median counts: a simulation that stood still for once is not slow
LONGEST_STEP_S = 0.1  # s that time runs on without a message
LOOK_S = 0.01  # s of the wall clock, after which a thread that waits looks at the time again


class SimulatedTime:
    """The time that messages on /clock say, carried on by the wall clock until the next is due.

    It never goes back while the messages come at one rate. Where /clock is set back, it runs on from where it is, ahead of
    /clock. One thread calls tick(), any may call now().

    Attributes:
        runs: whether a message came.
        ahead_s: s, by how much it is ahead of /clock.

    Args:
        wall: s, monotonic.
    """

    def __init__(self, wall: Callable[[], float] = time.monotonic) -> None:
        self.runs, self.ahead_s = False, 0.0
        self._wall = wall
        self._rates: deque[float] = deque(maxlen=REMEMBERED)
        self._line = (0.0, 0.0, 1.0, 0.0)  # s of the wall, s, rate, longest way ahead [s]

    def tick(self, clock_s: float) -> None:
        """Take a message on /clock."""
        now = self._wall()
        then, before_s, _, _ = self._line
        set_back = self.runs and clock_s + self.ahead_s < before_s
        if set_back:
            self.ahead_s = self.now() - clock_s
        simulated_s = clock_s + self.ahead_s
        step = simulated_s - before_s
        if self.runs and step == 0.0:  # said again
            return
        if set_back or not self.runs:
            self._rates.clear()
            step = 0.0
        elif now > then:
            self._rates.append(step / (now - then))
        rate = median(self._rates) if self._rates else 1.0
        self._line = (now, simulated_s, rate, min(step, LONGEST_STEP_S))
        self.runs = True

    def now(self) -> float:
        """Simulated time [s]; 0 before the first message."""
        then, simulated_s, rate, longest_s = self._line
        return simulated_s + min(max(self._wall() - then, 0.0) * rate, longest_s)

    def wall(self, duration_s: float) -> float:
        """How long [s] to wait on the wall clock for a simulated duration, before the time is looked at again."""
        return min(duration_s / max(self._line[2], 1e-3), LOOK_S)
