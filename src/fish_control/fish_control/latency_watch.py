# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Notices when the time from a pose's stamp to its arrival changes for good: a clock was set, or images come later."""

from __future__ import annotations

from collections import deque
from statistics import median

KEPT = 30  # latencies, whose median is the usual one
FIRST = 3  # of them before there is a usual one
LEAST_STEP = 0.1  # s; smaller changes are left to the comparison of headings
POSES = 8  # in a row that must agree on the new latency
STEADY = 0.05  # s, within which they agree


class LatencyWatch:
    """Feed it the latency of every pose [s], as it is stamped."""

    def __init__(self) -> None:
        self._usual: deque[float] = deque(maxlen=KEPT)
        self._strange: deque[float] = deque(maxlen=POSES)

    @property
    def usual(self) -> float | None:
        """Median of the last latencies [s]; None before there are enough."""
        return median(self._usual) if len(self._usual) >= FIRST or self._strange else None

    @property
    def strange(self) -> bool:
        """Whether the last latency was not the usual one."""
        return bool(self._strange)

    def add(self, latency: float) -> float | None:
        """One more; the new usual latency [s] where it has changed, otherwise None."""
        usual = self.usual
        if usual is None or abs(latency - usual) <= LEAST_STEP:
            self._strange.clear()
            self._usual.append(latency)
            return None
        self._strange.append(latency)
        if len(self._strange) < POSES or max(self._strange) - min(self._strange) >= STEADY:
            return None
        stepped = median(self._strange)
        self._usual.clear()
        self._usual.extend(self._strange)
        self._strange.clear()
        return stepped
