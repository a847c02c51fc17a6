"""Fusion of camera and IMU; a camera pose counts at the moment it was taken, not when it arrives."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_control.imu_history import ImuHistory, InertialSample
from fish_control.measurement_buffer import CameraPose, Moment, Timeline
from fish_control.strapdown import SIZE, MotionNoise, StrapdownFilter, pose_residual

Array = NDArray[np.float64]
LOST_VARIANCE = (
    1e4  # published for a pose without camera or a twist without IMU: unusable, in any unit
)
START_STD = (
    0.02,
    0.02,
    0.1,
    0.2,
    0.2,
    0.05,
    0.3,
    0.3,
)  # m, rad, m/s, rad/s, m/s^2; of the state when it starts
FASTEST_SWIM = 0.6  # m/s, poses of one fish are no farther apart
FASTEST_TURN = 4.0  # rad/s
SILENT_POSES = (
    3  # that arrive without an IMU sample in between say that the IMU is dead; stamps alone cannot
)
OLD_POSES = 3  # in a row, from before the history, say that the clock was set back when no IMU is there to say it


@dataclass(frozen=True)
class FusionConfig(MotionNoise):
    """Constants of the fusion and its motion model; standard deviations unless said otherwise."""

    camera_position_noise: float = 0.004  # m, floor under what the camera message says
    camera_heading_noise: float = 0.02  # rad, floor
    gate: float = 16.27  # squared Mahalanobis distance, chi^2 of 3 at 99.9 %
    history: float = 1.0  # s, how late a camera pose may come
    camera_timeout: float = 0.6  # s without an accepted pose: camera lost
    imu_timeout: float = (
        0.1  # s without a sample: IMU lost; s that a pose may be ahead of the newest sample
    )
    reacquire_time: float = (
        1.0  # s of poses that agree, but not with the estimate: start anew from them
    )
    start_frames: int = 3  # poses that must agree before the first estimate
    camera_offset: float = (
        0.0  # s, added to camera stamps (negative if images are older than their stamps)
    )
    largest_accel: float = (
        20.0  # m/s^2 in the plane; a sample above it is wrong (trials reach 1.84)
    )
    largest_yaw_rate: float = 12.0  # rad/s; a sample above it is wrong (trials reach 5.3)

    def __post_init__(self) -> None:
        for f in fields(FusionConfig):
            value = getattr(self, f.name)
            lowest = -0.5 if f.name == "camera_offset" else 0.0
            if not (math.isfinite(value) and (value > lowest or value == f.default)):
                raise ValueError(f"{f.name} is {value!r}, expected a finite number > {lowest:g}")


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


class Fusion:
    """Feed it samples and poses with their stamps; ask for the estimate."""

    def __init__(self, config: FusionConfig | None = None) -> None:
        self.config = config or FusionConfig()
        self._filter = StrapdownFilter(self.config)
        self.counts: Counter[str] = Counter()  # what became of the measurements, for diagnostics
        self._clear()

    def _clear(self) -> None:
        self._imu = ImuHistory(self.config.imu_timeout)
        self._timeline: Timeline | None = None
        self._candidates: list[
            tuple[float, Array]
        ] = []  # poses in a row that agree with each other
        self._last_pose_time = self._last_imu_time = -math.inf
        self._poses_in_a_row = SILENT_POSES  # without an IMU sample in between
        self._old_poses = 0  # in a row, from before the history

    def _restart(self) -> None:
        self._clear()
        self.counts["restarted"] += 1

    def add_imu(self, time: float, yaw_rate: float, forward: float, left: float) -> bool:
        """A sample stamped `time` [s]: gyro [rad/s], specific force [m/s^2]. False if it was not used.

        What no fish does is a damaged sample, such as one of a flipped bit: it would move a trusted pose, and the camera,
        which contradicts it, would be refused until reacquire_time.
        """
        if not all(map(math.isfinite, (time, yaw_rate, forward, left))):
            return self._refuse("imu_not_finite")
        largest = self.config.largest_accel, self.config.largest_yaw_rate
        if math.hypot(forward, left) > largest[0] or abs(yaw_rate) > largest[1]:
            return self._refuse("imu_implausible")
        if (
            time < self._last_imu_time - self.config.history
        ):  # the clock was set back: a restarted simulation
            self._restart()
        if time <= self._last_imu_time:
            return self._refuse("imu_out_of_order")
        self._last_imu_time, self._poses_in_a_row = time, 0
        self.counts["imu"] += 1
        sample = InertialSample(yaw_rate, forward, left)
        if self._timeline is None:
            self._imu.add(time, sample)
            self._imu.forget(time - self.config.history)
        elif time > self._timeline.first.time:
            self._timeline.insert_inertial(time, sample)
            self._timeline.forget(time - self.config.history)
        return True

    def add_pose(self, time: float, pose: ArrayLike, covariance: Array | None = None) -> bool:
        """A camera pose (x, y, psi) [m, m, rad] stamped `time` [s]; False if it was not used."""
        camera = CameraPose(np.array(pose, dtype=float), self._noise(covariance))
        time += self.config.camera_offset
        if not (
            math.isfinite(time)
            and np.all(np.isfinite(camera.pose))
            and np.all(np.isfinite(camera.R))
        ):
            return self._refuse("pose_not_finite")
        imu_lives = self._poses_in_a_row < SILENT_POSES
        self._poses_in_a_row += 1
        if imu_lives and time > self._last_imu_time + self.config.imu_timeout:
            return self._refuse("pose_from_future")
        old = not imu_lives and time < self._last_pose_time - self.config.history
        self._old_poses = self._old_poses + 1 if old else 0
        if self._old_poses >= OLD_POSES:
            self._restart()
        if self._timeline is None:
            return self._start(time, camera.pose)
        if time <= self._timeline.first.time:
            return self._refuse("pose_too_late")
        y, S = self._timeline.predict(time).innovation(camera.pose, camera.R)
        if float(y @ np.linalg.solve(S, y)) > self.config.gate:
            self.counts["pose_outlier"] += 1
            return self._reacquire(time, camera.pose)
        self._timeline.insert_pose(time, camera)
        self._timeline.forget(time - self.config.history)
        self._last_pose_time = max(self._last_pose_time, time)
        self._candidates.clear()
        self.counts["pose"] += 1
        return True

    def estimate(self, silence: float = 0.0) -> Estimate | None:
        """State at the newest IMU sample, without an IMU at the newest pose; None before the first.

        silence: s since a measurement was used; with it the sensors' stamps say what is lost. Negative counts as 0.
        """
        if self._timeline is None:
            return None
        now = self._timeline.last.time + max(0.0, silence)
        imu_lost = now - self._last_imu_time > self.config.imu_timeout
        # a camera whose clock is a little ahead must not hold the estimate at its stamp until the IMU is there
        moment = self._timeline.last if imu_lost else self._timeline.at(self._last_imu_time)
        if moment is None:
            return None
        camera_lost = now - self._last_pose_time > self.config.camera_timeout
        return _to_estimate(moment, self._imu.at(moment.time), camera_lost, imu_lost)

    def _refuse(self, reason: str) -> bool:
        self.counts[reason] += 1
        return False

    def _noise(self, covariance: Array | None) -> Array:
        """R of a camera pose: what its message says, but not below the floor."""
        floor = (
            np.array([self.config.camera_position_noise] * 2 + [self.config.camera_heading_noise])
            ** 2
        )
        return np.diag(floor if covariance is None else np.maximum(np.diag(covariance), floor))

    def _start(self, time: float, pose: Array) -> bool:
        """Wait for poses that agree, then begin at rest at the last one."""
        if self._agreeing(time, pose) < self.config.start_frames:
            return False
        self.counts["started"] += 1
        return self._begin(
            Moment(time, x=np.r_[pose, np.zeros(SIZE - 3)], P=np.diag(START_STD) ** 2)
        )

    def _reacquire(self, time: float, pose: Array) -> bool:
        """Believe poses that contradict the estimate once they have agreed for long enough."""
        agreeing = self._agreeing(time, pose)
        waited = time - self._candidates[0][0] >= self.config.reacquire_time
        if self._timeline is None or agreeing < self.config.start_frames or not waited:
            return False
        known = self._timeline.last  # the sensors' biases are what they were
        x, P = np.r_[pose, 0.0, 0.0, known.x[5:]], np.diag(START_STD) ** 2
        P[5:, 5:] = known.P[5:, 5:]
        self.counts["reacquired"] += 1
        return self._begin(Moment(time, x=x, P=P))

    def _begin(self, moment: Moment) -> bool:
        self._timeline = Timeline(self._filter, self._imu, moment)
        self._last_pose_time = moment.time
        self._candidates.clear()
        return True

    def _agreeing(self, time: float, pose: Array) -> int:
        """Keep a candidate; how many in a row could be one swimming fish."""
        if self._candidates:
            before, previous = self._candidates[-1]
            dt = time - before
            apart = np.abs(pose_residual(pose.copy(), previous))
            near = (
                math.hypot(apart[0], apart[1]) <= FASTEST_SWIM * dt + 0.03
                and apart[2] <= FASTEST_TURN * dt + 0.1
            )
            if not (0.0 < dt <= 0.5 and near):
                self._candidates.clear()
        self._candidates.append((time, pose))
        return len(self._candidates)


def _to_estimate(
    moment: Moment, imu: InertialSample | None, camera_lost: bool, imu_lost: bool
) -> Estimate:
    x, P = moment.x, moment.P
    c, s = math.cos(x[2]), math.sin(x[2])
    R = np.array([[c, s], [-s, c]])  # pool to body
    u, v = R @ x[3:5]
    J = np.column_stack([[v, -u], R])  # d (u, v) / d (psi, v_x, v_y)
    twist_P = np.zeros((3, 3))
    twist_P[:2, :2], twist_P[2, 2] = J @ P[2:5, 2:5] @ J.T, P[5, 5]
    lost = np.eye(3) * LOST_VARIANCE
    return Estimate(
        time=moment.time,
        pose=x[:3].copy(),
        twist=np.array([u, v, imu.yaw_rate - x[5] if imu is not None else 0.0]),
        pose_covariance=lost if camera_lost else P[:3, :3].copy(),
        twist_covariance=lost if imu_lost else twist_P,
        gyro_bias=float(x[5]),
        camera_lost=camera_lost,
        imu_lost=imu_lost,
    )
