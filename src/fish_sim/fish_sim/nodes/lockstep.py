"""Whether the nodes that close the loop have kept up with the simulation."""

from __future__ import annotations

from fish_sim.model import DT

AHEAD = 0.03  # s of simulated time that the simulation may at most be ahead of those it waits for


class Lockstep:
    """Holds simulated time until everybody who was heard before has answered to it.

    A computer that is busy with other things then makes a run longer, not worse: who answers to every period is waited
    for in every period, who answers to every second one in every second. Who stays silent for longer than `patience`
    [s of real time] is not waited for until heard again; with patience 0 nobody is.
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._answers: dict[str, float] = {}
        self._ahead: dict[
            str, float
        ] = {}  # s that each may be behind: the time between its answers, less half a period
        self._since: float | None = None

    def answered(self, who: str, stamp: float) -> None:
        """A message for this simulated time [s] came in."""
        if who in self._answers:
            self._ahead[who] = min(max(stamp - self._answers[who], DT) - 0.5 * DT, AHEAD)
        self._answers[who] = stamp

    def may_advance(self, simulated: float, now: float) -> bool:
        """Whether the simulation at `simulated` [s] may go on at the real time `now` [s]."""
        late = [
            who
            for who, stamp in self._answers.items()
            if stamp < simulated - self._ahead.get(who, AHEAD)
        ]
        if not late or self._patience == 0.0:
            self._since = None
            return True
        if self._since is None:
            self._since = now
        if now - self._since <= self._patience:
            return False
        for who in late:
            del self._answers[who]
            self._ahead.pop(who, None)
        self._since = None
        return True
