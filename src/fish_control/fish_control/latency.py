# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Percentiles of a running series of delays."""

from __future__ import annotations

from collections import deque

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
