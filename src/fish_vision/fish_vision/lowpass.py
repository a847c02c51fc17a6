# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Low-pass filter over the poses of the tracker, with stamps that take its delay into account."""

from dataclasses import replace
from math import exp, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.pose import wrap
from fish_vision.tracker import Detection

Array = NDArray[Any]  # float64

TOGETHER = 0.05  # share of the time constant by which the means of head and tail may differ in time


class _Mean:
    """First-order low-pass of a vector and of its time, with the same weights."""

    def __init__(self, tau: float, time: float, value: Array) -> None:
        self._tau, self._last = tau, time
        self.time, self.value = time, value

    def add(self, time: float, value: Array) -> None:
        """Take over one more sample."""
        a = 1.0 - exp(-(time - self._last) / self._tau)
        self._last = time
        self.time += a * (time - self.time)
        self.value = self.value + a * (value - self.value)


class PoseLowPass:
    """First-order low-pass of x, y, heading and tail.

        a_k = 1 - exp(-2 pi cutoff (t_k - t_{k-1})),  y_k = y_{k-1} + a_k (x_k - y_{k-1})

    The stamp goes through the same filter, so that a pose is right at its stamp while the fish moves at a constant
    velocity, whatever the frames' distances. A pose is then stamped 1 / (2 pi cutoff) before its image, less half a
    frame's time. Motion at the cutoff frequency keeps 0.71 of its amplitude. The covariance stays that of one image.

    Args:
        cutoff: Hz; 0 gives every pose back as it came.
        restart: s without a pose after which the filter starts again.
    """

    def __init__(self, cutoff: float, restart: float) -> None:
        self._tau = 1.0 / (2.0 * pi * cutoff) if cutoff > 0.0 else 0.0
        self._restart = restart
        self._head: _Mean | None = None
        self._tail: _Mean | None = None
        self._last = (0.0, 0.0)  # stamp, heading without jumps

    def filtered(self, found: Detection) -> Detection:
        """The pose that belongs to a newly detected one, with its own stamp.

        The tail is left out for about three time constants after it comes back in sight.
        """
        if not self._tau:
            return found
        since = found.stamp - self._last[0]
        if self._head is None or not 0.0 < since <= self._restart:
            self._head = self._tail = None
        heading = found.head.heading
        if self._head is not None:
            heading = self._last[1] + wrap(heading - self._last[1])
        self._last = found.stamp, heading
        pose = np.array([found.head.x, found.head.y, heading])
        self._head = self._added(self._head, found.stamp, pose)
        tail = None if found.tail is None else np.array(found.tail)
        self._tail = None if tail is None else self._added(self._tail, found.stamp, tail)
        x, y, heading = map(float, self._head.value)
        head = replace(found.head, x=x, y=y, heading=wrap(heading))
        return replace(found, stamp=self._head.time, head=head, tail=self._tail_now())

    def _added(self, mean: _Mean | None, time: float, value: Array) -> _Mean:
        if mean is None:
            return _Mean(self._tau, time, value)
        mean.add(time, value)
        return mean

    def _tail_now(self) -> tuple[float, ...] | None:
        """The tail's angles if they belong to the same time as the head's pose."""
        assert self._head is not None
        if self._tail is None or abs(self._tail.time - self._head.time) > TOGETHER * self._tau:
            return None
        return tuple(map(float, self._tail.value))
