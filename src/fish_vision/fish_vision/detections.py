# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What becomes of the tracker's detections: filtered poses and statistics.

A low-pass filter over the poses has stamps that take its delay into account. Counts, times, and whether the calibration still
fits, are for diagnostics.
"""

from collections import Counter, deque
from dataclasses import replace
from math import exp, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fish_vision.choice import Reason
from fish_vision.pose import wrap
from fish_vision.tracker import Detection, Lost

Array = NDArray[Any]  # float64

TOGETHER = 0.05  # share of the time constant by which the means of head and tail may differ in time

RECENT = 300  # samples of a time
SPACINGS = 60  # poses before the markers' spacing is judged
SPACING_LIMIT = 0.015  # share by which the mean spacing may differ from the true one
SCATTER = 0.01  # standard deviation, share, of spacings that come from one wrong scale


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


class Statistics:
    """Counts of results since the start; recent times and spacings."""

    def __init__(self) -> None:
        self.tracked = 0
        self.whole_image = 0
        self.lost: Counter[str] = Counter()  # reason -> images
        self.refused: Counter[str] = Counter()  # bad message -> images
        self.last_error = ""  # text of the newest bad message
        self.last_reason = ""  # of the newest lost image
        self._spacings: deque[float] = deque(maxlen=SPACINGS)
        self._refused_spacings: deque[float] = deque(
            maxlen=SPACINGS
        )  # since the last pose, less one
        self._work: deque[float] = deque(maxlen=RECENT)
        self._age: deque[float] = deque(maxlen=RECENT)

    def add(self, found: Detection | Lost, work: float, age: float) -> None:
        """One image: result, time it took (s), time from its stamp to the result (s)."""
        self._work.append(work)
        self._age.append(age)
        if isinstance(found, Lost):
            self.last_reason = found.reason.value
            self.lost[self.last_reason] += 1
            if found.reason in (Reason.NO_PAIR, Reason.TAG_SIZE) and found.spacing is not None:
                self._refused_spacings.append(found.spacing)
            return
        self._refused_spacings.clear()
        self.tracked += 1
        self.whole_image += found.whole_image
        self._spacings.append(found.spacing)

    def refuse(self, kind: str, error: str) -> None:
        """One message that could not be used."""
        self.refused[kind] += 1
        self.last_error = error

    @property
    def images(self) -> int:
        """Images looked at, with or without result."""
        return self.tracked + sum(self.lost.values())

    def spacing_error(self) -> float | None:
        """Mean misfit (share) of the markers' spacing if it shows a wrong calibration, else None."""
        if len(self._spacings) < SPACINGS:
            return None
        error = float(np.mean(self._spacings)) - 1.0
        return error if abs(error) > SPACING_LIMIT else None

    def refused_spacing(self) -> float | None:
        """Mean misfit (share) of the markers' spacing where every image is refused for the same one, else None.

        A camera_info with a focal length 5 % too short shows all distances 5 % too long, and a fish at the pool's
        end 0.1 m off.
        """
        values = np.array(self._refused_spacings)
        if len(values) < SPACINGS or float(np.std(values)) > SCATTER:
            return None
        return float(np.mean(values))

    def values(self) -> dict[str, str]:
        """All numbers, ready for a diagnostic message."""
        result = {"tracked": str(self.tracked), "from_whole_image": str(self.whole_image)}
        result |= {f"lost: {reason}": str(n) for reason, n in self.lost.items()}
        result |= {f"refused: {kind}": str(n) for kind, n in self.refused.items()}
        for name, times in (("processing_ms", self._work), ("stamp_to_pose_ms", self._age)):
            if times:
                p50, p99 = np.percentile(np.array(times) * 1e3, [50, 99])
                result |= {f"{name}_p50": f"{p50:.2f}", f"{name}_p99": f"{p99:.2f}"}
        return result
