"""A filter over measurements that arrive late and out of order.

Every measurement of the last second is kept at the moment it was taken, with the filter's state after it.
One that arrives late is put in its place and everything after it is replayed; the order of arrival therefore
makes no difference.
"""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fish_control.imu_history import ImuHistory, InertialSample
from fish_control.strapdown import SIZE, StrapdownFilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CameraPose:
    """A measured pose (x, y, psi) [m, m, rad] and its covariance (3, 3)."""

    pose: Array
    R: Array


@dataclass
class Moment:
    """The filter at one time; `camera` is None where only the IMU measured."""

    time: float  # s
    camera: CameraPose | None = None
    x: Array = field(default_factory=lambda: np.zeros(SIZE))
    P: Array = field(default_factory=lambda: np.eye(SIZE))


class Timeline:
    """Moments in order; the first one is where every replay begins at the earliest."""

    def __init__(self, filter: StrapdownFilter, imu: ImuHistory, begin: Moment) -> None:
        self._filter = filter
        self._imu = imu
        self._moments = [begin]

    @property
    def first(self) -> Moment:
        """The earliest moment that is still known."""
        return self._moments[0]

    @property
    def last(self) -> Moment:
        """The newest."""
        return self._moments[-1]

    def at(self, time: float) -> Moment | None:
        """The newest that is not after `time` [s]; None if all are."""
        moment = self._moments[self._place(time) - 1]
        return moment if moment.time <= time else None

    def predict(self, time: float) -> StrapdownFilter:
        """The filter at `time` [s], before anything measured there; valid until the next call."""
        before = self._moments[self._place(time) - 1]
        self._filter.set(before.x, before.P)
        self._advance(before.time, time)
        return self._filter

    def insert_inertial(self, time: float, sample: InertialSample) -> None:
        """Take in an IMU sample that is newer than all others."""
        self._imu.add(time, sample)
        self._insert(Moment(time))

    def insert_pose(self, time: float, camera: CameraPose) -> None:
        """Take in a camera pose of any time after `first`."""
        self._insert(Moment(time, camera))

    def forget(self, before: float) -> None:
        """Drop what is older than `before` [s]; the state there remains as `first`."""
        keep = self._place(before) - 1
        if keep > 0:
            del self._moments[:keep]
            self._imu.forget(self.first.time - self._imu.reach)

    def _place(self, time: float) -> int:
        return max(bisect.bisect_right(self._moments, time, key=lambda moment: moment.time), 1)

    def _insert(self, moment: Moment) -> None:
        """Put the moment in its place and replay from there.

        Poses taken since the IMU sample before are replayed too: what the IMU did at them is known only now.
        """
        index = self._place(moment.time)
        self._moments.insert(index, moment)
        while index > 1 and self._moments[index - 1].camera is not None:
            index -= 1
        before = self._moments[index - 1]
        self._filter.set(before.x, before.P)
        for current in self._moments[index:]:
            self._advance(before.time, current.time)
            if current.camera is not None:
                self._filter.correct(current.camera.pose, current.camera.R)
            current.x, current.P = self._filter.x.copy(), self._filter.P.copy()
            before = current

    def _advance(self, start: float, end: float) -> None:
        """Predict from `start` to `end` [s], from one IMU sample to the next.

        There are samples in between, without moments of their own, where a late pose began the timeline. What the head
        did in a gap longer than a sample's reach the gap's ends do not tell.
        """
        if end <= start:
            return
        for time in (*self._imu.times(start, end), end):
            known = time - start <= self._imu.reach
            self._filter.advance(
                time - start, *(self._imu.at(t) if known else None for t in (start, time))
            )
            start = time
