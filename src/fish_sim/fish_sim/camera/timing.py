# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When the camera takes its frames, and where the fish was then."""

from bisect import bisect_right
from collections import deque
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

JUMP = 1.0  # s without a call after which the frames between are not counted as skipped
Array = NDArray[Any]  # float64


class History:
    """The last second of a measured vector, linearly interpolated between its samples.

    Angles among the components (given by index) are unwrapped, so that they are interpolated the short way
    round.
    """

    def __init__(self, angles: tuple[int, ...] = (), span: float = 1.0) -> None:
        self._angles, self._span = list(angles), span
        self._times: deque[float] = deque()
        self._values: deque[Array] = deque()

    def add(self, time: float, value: Array) -> None:
        """Append a sample; a time before the last one (a reset simulation) forgets everything before."""
        value = np.array(value, float)
        if self._times and (time < self._times[-1] or value.shape != self._values[-1].shape):
            self._times.clear()
            self._values.clear()
        if self._values:
            turn = self._values[-1][self._angles] - value[self._angles]
            value[self._angles] += 2 * pi * np.round(turn / (2 * pi))
        self._times.append(time)
        self._values.append(value)
        while self._times[0] < time - self._span:
            self._times.popleft()
            self._values.popleft()

    def at(self, time: float) -> Array | None:
        """Value at a time (s); the first or last sample outside the samples' times, None without any."""
        if not self._times:
            return None
        i = bisect_right(self._times, time)
        if i == 0 or i == len(self._times):
            return self._values[min(i, len(self._times) - 1)]
        t_0, t_1 = self._times[i - 1], self._times[i]
        share = (time - t_0) / (t_1 - t_0)
        return (1.0 - share) * self._values[i - 1] + share * self._values[i]


class FrameClock:
    """Exposure times at a fixed rate: multiples of the period."""

    def __init__(self, rate_hz: float) -> None:
        self._rate = rate_hz
        self._taken: int | None = None  # number of the last frame taken
        self.skipped = 0  # frames that came due together with a later one

    def due(self, time: float) -> float | None:
        """Exposure time (s) of the newest frame not after time that was not taken yet, or None.

        A time that jumps (a reset or paused simulation) starts again.
        """
        frame = int(np.floor(time * self._rate + 1e-6))
        ahead = None if self._taken is None else frame - self._taken
        if ahead in (-1, 0):
            return None
        if ahead is not None and 0 < ahead <= max(1.0, JUMP * self._rate):
            self.skipped += ahead - 1
        self._taken = frame
        return frame / self._rate
