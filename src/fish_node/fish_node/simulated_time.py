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

    It never goes back while the messages do not. One thread calls tick(), any may call now().

    Attributes:
        runs: whether a message came.

    Args:
        wall: s, monotonic.
    """

    def __init__(self, wall: Callable[[], float] = time.monotonic) -> None:
        self.runs = False
        self._wall = wall
        self._rates: deque[float] = deque(maxlen=REMEMBERED)
        self._line = (0.0, 0.0, 1.0, 0.0)  # s of the wall, s, rate, longest way ahead [s]

    def tick(self, simulated_s: float) -> None:
        """Take a message on /clock."""
        now = self._wall()
        then, before_s, _, _ = self._line
        step = simulated_s - before_s
        if self.runs and step == 0.0:  # said again
            return
        if not self.runs or step < 0.0:  # the first, or the simulation began anew
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
