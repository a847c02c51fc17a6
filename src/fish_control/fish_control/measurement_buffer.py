# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A filter over camera poses that arrive late and out of order.

Every pose of the last seconds is kept at the moment it was taken, with the filter's state after it. One that arrives
late is put in its place and those after it are replayed; the order of arrival therefore makes no difference. Between two
poses the IMU's samples are integrated at once.
"""

from __future__ import annotations

import bisect
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fish_control.imu_history import ImuHistory
from fish_control.strapdown import SIZE, START_STD, StrapdownFilter

Array = NDArray[np.float64]
LONGEST_SILENCE = 0.05  # s, of the camera before the history; less is not worth a prediction


class CameraPose(NamedTuple):
    """A measured pose."""

    pose: Array  # (3,) x, y, psi [m, m, rad]
    R: Array  # (3, 3) its covariance
    fade: float = 1.0  # by which the predicted covariance is multiplied: more than 1 where the motion is doubted


class RawPose(NamedTuple):
    """A pose as it came, kept in case the camera's offset changes."""

    stamp: float  # s
    camera: CameraPose

    def after(self, others: Iterable[RawPose], reach: float) -> deque[RawPose]:
        """It and the others whose stamps are within `reach` [s] of its own: one from far ahead would stay for ever."""
        return deque((*(raw for raw in others if abs(raw.stamp - self.stamp) <= reach), self))


@dataclass
class Moment:
    """The filter at one time, after the pose taken then; the first one may have none."""

    time: float  # s
    camera: CameraPose | None = None
    x: Array = field(default_factory=lambda: np.zeros(SIZE))
    P: Array = field(default_factory=lambda: np.eye(SIZE))


def start_moment(time: float, pose: Array, known: Moment | None = None) -> Moment:
    """A fish at rest at a camera's pose (x, y, psi); the sensors' biases are those of `known`."""
    x, P = np.r_[pose, np.zeros(SIZE - 3)], np.diag(START_STD) ** 2
    if known is not None:
        x[5:], P[5:, 5:] = known.x[5:], known.P[5:, 5:]
    return Moment(time, x=x, P=P)


class Timeline:
    """Moments in order; the first one is where every replay begins at the earliest."""

    def __init__(self, filter: StrapdownFilter, imu: ImuHistory, begin: Moment) -> None:
        self._filter = filter
        self._imu = imu
        self._moments = [begin]
        self._head: Moment | None = None  # the newest prediction, from which the next one goes on
        self._predicted: float | None = None  # s, of what the filter holds, if it is a prediction

    @property
    def first(self) -> Moment:
        """The earliest moment that is still known."""
        return self._moments[0]

    @property
    def last(self) -> Moment:
        """The newest."""
        return self._moments[-1]

    def since(self, time: float) -> list[Moment]:
        """The newest moment up to `time` [s] and all after it."""
        return self._moments[self._place(time) - 1 :]

    def predict(self, time: float) -> StrapdownFilter:
        """The filter at `time` [s] without what the camera says there; valid until the next call."""
        before = self._moments[self._place(time) - 1]
        self._filter.set(before.x, before.P)
        if time > before.time:
            self._filter.advance(self._imu.between(before.time, time))
        self._predicted = time
        return self._filter

    def at(self, time: float) -> Moment:
        """The state at `time` [s], after the poses taken until then; times that grow cost one step each."""
        head = self._head
        if head is None or not self.last.time <= head.time <= time:
            if time >= self.last.time:
                head = self.last
            else:
                head = self._moments[self._place(time) - 1]
        self._filter.set(head.x, head.P)
        self._predicted = None
        if time > head.time:
            self._filter.advance(self._imu.between(head.time, time))
        found = Moment(max(time, head.time), None, self._filter.x.copy(), self._filter.P.copy())
        self._head = found if time >= self.last.time else None
        return found

    def insert(self, time: float, camera: CameraPose) -> None:
        """Take in a camera pose of any time after `first`."""
        index = self._place(time)
        if index == len(self._moments) and self._predicted == time:
            self._filter.correct(*camera)
            x, P = self._filter.x.copy(), self._filter.P.copy()
            self._moments.append(Moment(time, camera, x, P))
            self._head = self._predicted = None
            return
        self._moments.insert(index, Moment(time, camera))
        self._replay(index)

    def imu_came(self, previous: float) -> None:
        """Replay the poses taken since the IMU sample before, at `previous` [s]: what the IMU did is known only now."""
        if self.last.time > previous and len(self._moments) > 1:
            self._replay(max(1, self._place(previous)))

    def forget(self, before: float) -> None:
        """Drop what is older than `before` [s]; the state there remains as `first`.

        Where no pose has come since, the state is predicted up to there, so that the IMU may forget what was before.
        """
        if self.last.time < before - LONGEST_SILENCE:
            state = self.predict(before)
            self._moments = [Moment(before, None, state.x.copy(), state.P.copy())]
            self._predicted = None
            return
        keep = self._place(before) - 1
        if keep > 0:
            del self._moments[:keep]

    def _place(self, time: float) -> int:
        return max(bisect.bisect_right(self._moments, time, key=lambda moment: moment.time), 1)

    def _replay(self, index: int) -> None:
        self._head = self._predicted = None
        before = self._moments[index - 1]
        self._filter.set(before.x, before.P)
        for current in self._moments[index:]:
            if current.time > before.time:
                self._filter.advance(self._imu.between(before.time, current.time))
            if current.camera is not None:
                self._filter.correct(*current.camera)
            current.x, current.P = self._filter.x.copy(), self._filter.P.copy()
            before = current
