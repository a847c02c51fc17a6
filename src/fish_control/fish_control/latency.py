# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Delays: percentiles of a running series, and a lasting change of the time from a pose's stamp to its arrival."""

from __future__ import annotations

from collections import deque
from statistics import median

import numpy as np


class Latency:
    """The last `size` delays [s]."""

    def __init__(self, size: int = 3000) -> None:
        self._values: deque[float] = deque(maxlen=size)

    def add(self, delay: float) -> None:
        """One more."""
        self._values.append(delay)

    def percentiles(self) -> tuple[float, float] | None:
        """(p50, p99) [s]; None without values."""
        if not self._values:
            return None
        p50, p99 = np.percentile(np.fromiter(self._values, dtype=float), [50.0, 99.0])
        return float(p50), float(p99)


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
