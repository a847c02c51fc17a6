# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""How fast the simulation may run: with real time, and no faster than the nodes that close the loop. Knows no ROS."""

from __future__ import annotations

import math

from fish_sim.model import DT

ROUNDING = 1e-6  # periods
MAX_LAG = 0.2  # s of real time; a simulation further behind gives up what it missed


class Pacer:
    """Keeps simulated time at `factor` times real time; factor 0 is as fast as possible.

    It is never ahead of real time: stamps from the future look like another clock. A short lag is caught up with; after a
    longer one the lost time is skipped and counted.
    """

    def __init__(self, factor: float, period: float, now: float) -> None:
        self._factor, self._period = factor, period
        self.lost = 0.0  # s of real time skipped
        self.restart(now)

    def restart(self, now: float) -> None:
        """Count from this moment [s]."""
        self._anchor, self._done = now, 0

    def due(self, now: float) -> int:
        """Number of periods to run now; they count as run. Negative never."""
        if self._factor == 0.0:
            return 1
        behind = (
            math.floor((now - self._anchor) * self._factor / self._period + ROUNDING) - self._done
        )
        if behind * self._period > MAX_LAG * max(1.0, self._factor):
            self.lost += behind * self._period / self._factor
            self.restart(now)
            return 0
        self._done += max(0, behind)
        return max(0, behind)


AHEAD = 0.03  # s of simulated time that the simulation may at most be ahead of those it waits for
STRICT = 0.5 * DT  # s, of who answers to every period
LOOSEN = 4.0  # s of real time; the middleware sends a lost message again after 3 s at most


class Lockstep:
    """Holds simulated time until everybody who was heard before has answered to it.

    A computer that is busy with other things then makes a run longer, not worse: everybody is waited for in every period.
    Who answers to every second one only shows it by silence (LOOSEN, or half the patience where that is less) and is
    then waited for in every second. Who stays silent for longer than `patience` [s of real time] is not waited for until
    he answers in time again: who speaks seldom, such as fusion without an IMU, would hold the time at every word. With
    patience 0 nobody is waited for.

    Args:
        patience: s of real time.
        slack: s of simulated time that everybody may be behind; real drivers on emulated devices are behind by some periods.
    """

    def __init__(self, patience: float, slack: float = 0.0) -> None:
        self._patience = patience
        self._least = max(slack, STRICT)
        self._most = max(AHEAD, self._least)
        self._loosen = min(LOOSEN, 0.5 * patience)
        self._answers: dict[str, float] = {}
        self._ahead: dict[str, float] = {}  # s that each may be behind
        self._given_up: set[str] = set()
        self._simulated = 0.0  # s, when last asked
        self._since: float | None = None
        self._awaited: list[str] = []

    @property
    def awaited(self) -> str:
        """Who is waited for; empty while time runs."""
        return ", ".join(self._awaited) if self._since is not None else ""

    def answered(self, who: str, stamp: float) -> None:
        """A message for this simulated time [s] came in."""
        if who in self._given_up and stamp < self._simulated - self._most:
            return
        self._given_up.discard(who)
        if who in self._answers:
            between = max(stamp - self._answers[who], DT)
            self._ahead[who] = max(min(self._ahead[who], between - STRICT), self._least)
        else:
            self._ahead[who] = self._least
        self._answers[who] = stamp

    def waited(self, now: float) -> float:
        """How long simulated time has stood at the real time `now` [s]."""
        return 0.0 if self._since is None else now - self._since

    def may_advance(self, simulated: float, now: float) -> bool:
        """Whether the simulation at `simulated` [s] may go on at the real time `now` [s]."""
        self._simulated = simulated
        late = self._awaited = self._late(simulated)
        if late and self._patience > 0.0:
            if self._since is None:
                self._since = now
            if self.waited(now) <= self._loosen:
                return False
            for who in late:
                self._ahead[who] = min(self._ahead[who] + DT, self._most)
            late = self._late(simulated)
            if late and self.waited(now) <= self._patience:
                return False
            for who in late:
                del self._answers[who], self._ahead[who]
            self._given_up.update(late)
        self._since = None
        return True

    def _late(self, simulated: float) -> list[str]:
        """Who has not answered to the time [s]."""
        return [who for who, stamp in self._answers.items() if stamp < simulated - self._ahead[who]]
