"""Fusion of camera and IMU; a camera pose counts at the moment it was taken, not when it arrives.

Events of the last second are kept in the order of their stamps, each with the filter's state after it. One
that arrives late is put in its place and everything after it is replayed; order of arrival therefore makes no
difference.
"""

from __future__ import annotations

import bisect
import math
from collections import Counter
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from fish_control.strapdown import SIZE, InertialSample, MotionNoise, StrapdownFilter, pose_residual

Array = NDArray[np.float64]
LOST_VARIANCE = 1e4  # published for a pose without camera or a twist without IMU: unusable, by any unit


@dataclass(frozen=True)
class FusionConfig(MotionNoise):
    """Constants of the fusion and its motion model; standard deviations unless said otherwise."""

    camera_position_noise: float = 0.004  # m, floor under what the camera message says
    camera_heading_noise: float = 0.02  # rad, floor
    gate: float = 16.27  # squared Mahalanobis distance, chi^2 of 3 at 99.9 %
    history: float = 1.0  # s, how late a camera pose may come
    camera_timeout: float = 0.6  # s without an accepted pose: camera lost
    imu_timeout: float = 0.1  # s without a sample: IMU lost
    reacquire_time: float = (
        1.0  # s of poses that agree with each other and not with the estimate: start anew from them
    )
    start_frames: int = 3  # poses that must agree before the first estimate
    camera_offset: float = 0.0  # s, added to camera stamps (negative if images are older than their stamps)

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            lowest = -0.5 if f.name == "camera_offset" else 0.0
            if not (math.isfinite(value) and (value > lowest or value == f.default)):
                raise ValueError(f"{f.name} is {value!r}, expected a finite number > {lowest}")


@dataclass(frozen=True)
class Estimate:
    """Pose in the pool, velocity over ground in base_link, and how far to trust them."""

    time: float  # s
    pose: Array  # (3,) x [m], y [m], psi [rad]
    twist: Array  # (3,) u [m/s], v [m/s], r [rad/s]
    pose_covariance: Array  # (3, 3)
    twist_covariance: Array  # (3, 3)
    gyro_bias: float  # rad/s
    camera_lost: bool
    imu_lost: bool


@dataclass
class _Event:
    time: float
    imu: InertialSample | None = None
    pose: Array | None = None
    R: Array | None = None
    x: Array = field(default_factory=lambda: np.zeros(SIZE))
    P: Array = field(default_factory=lambda: np.eye(SIZE))


class Fusion:
    """Feed it samples and poses with their stamps; ask for the estimate."""

    def __init__(self, config: FusionConfig | None = None) -> None:
        self.config = config or FusionConfig()
        self._filter = StrapdownFilter(self.config)
        self.counts: Counter[str] = Counter()  # what became of the measurements, for diagnostics
        self._clear()

    def _clear(self) -> None:
        self._events: list[_Event] = []
        self._candidates: list[tuple[float, Array]] = []  # recent poses that disagree, or before the start
        self._last_pose_time = -math.inf
        self._last_imu_time = -math.inf

    @property
    def started(self) -> bool:
        """Whether there is an estimate."""
        return bool(self._events)

    def add_imu(self, time: float, yaw_rate: float, forward: float, left: float) -> bool:
        """A sample stamped `time` [s]: gyro [rad/s], specific force [m/s^2]. False if it was not used."""
        if not all(map(math.isfinite, (time, yaw_rate, forward, left))):
            return self._refuse("imu_not_finite")
        if time < self._last_imu_time - self.config.history:  # the clock was set back: a restarted simulation
            self._clear()
            self.counts["restarted"] += 1
        if time <= self._last_imu_time:
            return self._refuse("imu_out_of_order")
        self._last_imu_time = time
        self.counts["imu"] += 1
        if self.started:
            self._insert(_Event(time, imu=InertialSample(yaw_rate, forward, left)))
            self._forget(time - self.config.history)
        return True

    def add_pose(self, time: float, pose: Array, covariance: Array | None = None) -> bool:
        """A camera pose (x, y, psi) stamped `time`; False if it was refused."""
        pose = np.array(pose, dtype=float)
        time += self.config.camera_offset
        R = self._noise(covariance)
        if not (np.all(np.isfinite(pose)) and math.isfinite(time) and np.all(np.isfinite(R))):
            return self._refuse("pose_not_finite")
        if not self.started:
            return self._start(time, pose)
        if time <= self._events[0].time:
            return self._refuse("pose_too_late")
        event = _Event(time, pose=pose, R=R)
        index = bisect.bisect_right([e.time for e in self._events], time)
        self._state_before(index, time)
        if self._accept(event):
            self._insert(event)
            self._last_pose_time = max(self._last_pose_time, time)
            self._candidates.clear()
            self.counts["pose"] += 1
            return True
        self.counts["pose_outlier"] += 1
        return self._reacquire(time, pose)

    def estimate(self, now: float | None = None) -> Estimate | None:
        """State at the newest event; `now` [s] (default: the same) decides what counts as lost."""
        if not self.started:
            return None
        event = self._events[-1]
        now = event.time if now is None else now
        camera_lost = now - self._last_pose_time > self.config.camera_timeout
        imu_lost = now - self._last_imu_time > self.config.imu_timeout
        return _to_estimate(event, self._imu_at(len(self._events) - 1), camera_lost, imu_lost)

    def _refuse(self, reason: str) -> bool:
        self.counts[reason] += 1
        return False

    def _noise(self, covariance: Array | None) -> Array:
        floor = np.array([self.config.camera_position_noise] * 2 + [self.config.camera_heading_noise]) ** 2
        if covariance is None:
            return np.diag(floor)
        return np.diag(np.maximum(np.diag(covariance), floor))

    def _start(self, time: float, pose: Array) -> bool:
        """Wait for poses that agree, then begin at rest at the last one."""
        if not self._agreeing(time, pose, self.config.start_frames):
            return False
        self._begin(time, pose)
        return True

    def _begin(self, time: float, pose: Array) -> None:
        sigma = np.array([0.02, 0.02, 0.1, 0.2, 0.2, 0.05, 0.3, 0.3])  # m, rad, m/s, rad/s, m/s^2
        known = self._events[-1] if self._events else None
        x = np.zeros(SIZE)
        x[:3] = pose
        if known is not None:
            x[5:], sigma[5:] = known.x[5:], np.sqrt(np.diag(known.P)[5:])
        self._events = [_Event(time, x=x, P=np.diag(sigma**2))]
        self._last_pose_time = time
        self._candidates.clear()
        self.counts["started"] += 1

    def _agreeing(self, time: float, pose: Array, frames: int) -> bool:
        """Keep the pose as a candidate; whether the last `frames` of them could be one fish."""
        if self._candidates:
            before, previous = self._candidates[-1]
            dt = time - before
            apart = np.abs(pose_residual(pose.copy(), previous))
            reach = 0.6 * max(dt, 0.0) + 0.03  # m, at most 0.6 m/s
            if dt <= 0.0 or dt > 0.5 or np.hypot(*apart[:2]) > reach or apart[2] > 4.0 * dt + 0.1:
                self._candidates.clear()
        self._candidates.append((time, pose))
        return len(self._candidates) >= frames

    def _reacquire(self, time: float, pose: Array) -> bool:
        """Believe poses that contradict the estimate once they have agreed for long enough."""
        agreeing = self._agreeing(time, pose, self.config.start_frames)
        if agreeing and time - self._candidates[0][0] >= self.config.reacquire_time:
            self._begin(time, pose)
            self.counts["reacquired"] += 1
            return True
        return False

    def _accept(self, event: _Event) -> bool:
        """Gate by Mahalanobis distance at the filter's present state."""
        y, S = self._filter.innovation(event.pose, event.R)
        return float(y @ np.linalg.solve(S, y)) <= self.config.gate

    def _insert(self, event: _Event) -> None:
        """Put the event in its place and replay everything from there."""
        index = bisect.bisect_right([e.time for e in self._events], event.time)
        self._events.insert(index, event)
        for i in range(index, len(self._events)):
            current = self._events[i]
            self._state_before(i, current.time, continued=i > index)
            if current.pose is not None:
                self._filter.correct(current.pose, current.R)
            current.x, current.P = self._filter.x.copy(), self._filter.P.copy()

    def _state_before(self, index: int, time: float, continued: bool = False) -> None:
        """Bring the filter to `time`, between events index - 1 and index."""
        before = self._events[index - 1]
        if not continued:
            self._filter.x, self._filter.P = before.x.copy(), before.P.copy()
        if time > before.time:
            after = self._interpolated_imu(index, time)
            self._filter.advance(time - before.time, self._imu_at(index - 1), after)

    def _imu_at(self, index: int) -> InertialSample:
        """What the IMU measured at an event: its own sample, or between its neighbours."""
        event = self._events[index]
        return event.imu if event.imu is not None else self._interpolated_imu(index, event.time)

    def _interpolated_imu(self, index: int, time: float) -> InertialSample:
        """IMU at `time` from the samples before and after position `index`."""
        before = next((e for e in reversed(self._events[:index]) if e.imu is not None), None)
        after = next((e for e in self._events[index:] if e.imu is not None), None)
        nearest = [
            e for e in (before, after) if e is not None and abs(e.time - time) <= self.config.imu_timeout
        ]
        if not nearest:
            return InertialSample(0.0, 0.0, 0.0, known=False)
        if len(nearest) == 1 or after.time <= before.time:
            return nearest[0].imu
        share = (time - before.time) / (after.time - before.time)
        a, b = before.imu, after.imu
        return InertialSample(
            a.yaw_rate + share * (b.yaw_rate - a.yaw_rate),
            a.forward + share * (b.forward - a.forward),
            a.left + share * (b.left - a.left),
        )

    def _forget(self, before: float) -> None:
        """Drop events that are too old to be replayed; the first one left is the base of every replay."""
        keep = bisect.bisect_right([e.time for e in self._events], before) - 1
        if keep > 0:
            del self._events[:keep]


def _to_estimate(event: _Event, imu: InertialSample, camera_lost: bool, imu_lost: bool) -> Estimate:
    x, P = event.x, event.P
    c, s = math.cos(x[2]), math.sin(x[2])
    R = np.array([[c, s], [-s, c]])  # pool to body
    u, v = R @ x[3:5]
    J = np.column_stack([[v, -u], R])  # d (u, v) / d (psi, v_x, v_y)
    pose_P, twist_P = P[:3, :3].copy(), np.zeros((3, 3))
    twist_P[:2, :2] = J @ P[2:5, 2:5] @ J.T
    twist_P[2, 2] = P[5, 5]
    if camera_lost:
        pose_P = np.eye(3) * LOST_VARIANCE
    if imu_lost:
        twist_P = np.eye(3) * LOST_VARIANCE
    r = imu.yaw_rate - x[5] if imu.known else 0.0
    return Estimate(
        event.time, x[:3].copy(), np.array([u, v, r]), pose_P, twist_P, float(x[5]), camera_lost, imu_lost
    )
