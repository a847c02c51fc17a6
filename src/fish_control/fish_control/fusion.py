# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fusion of camera and IMU; a camera pose counts at the moment it was taken, not when it arrives."""

from __future__ import annotations

import math
from collections import Counter, deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fish_control import measurement_checks as checks
from fish_control.camera_clock import LOOKS_BACK, CameraClock
from fish_control.estimate import Estimate, to_estimate
from fish_control.fusion_config import FusionConfig
from fish_control.imu_heading import HeadingNoise, ImuHeading
from fish_control.imu_history import ImuHistory, inertial_sample
from fish_control.measurement_buffer import CameraPose, Moment, RawPose, Timeline, start_moment
from fish_control.motion_models import MotionModels
from fish_control.strapdown import MotionModel, NoiseScale, StrapdownFilter

Array = NDArray[np.float64]
SILENT_POSES = 3  # in a row without an IMU sample in between: the IMU is dead; stamps cannot say it
SWIMS = 0.03  # m/s; a fish at rest does not show how well its motion is measured
LONGEST_WAIT = 0.3  # s, beyond imu_timeout, that a pose may be ahead of a living IMU: its clock, or the IMU has a gap
REFIT = 0.005  # s, change of the camera's offset after which the history is fused anew


class Fusion:
    """Feed it samples and poses with their stamps; ask for the estimate.

    Attributes:
        counts: what became of the measurements, for diagnostics.
        camera_clock: what is known of the camera's clock.
        imu_heading: the IMU's heading alone, and by how much it leads the gyro.
        noise_scale: factors on the variances, from the innovations.
    """

    def __init__(self, config: FusionConfig | None = None) -> None:
        self.config = config or FusionConfig()
        self.counts: Counter[str] = Counter()
        self.refused = ""  # why the latest measurement that was not used was not
        self.noise_scale = NoiseScale()
        self._filter = StrapdownFilter(self.config, self.noise_scale)
        self._models = MotionModels(self.config, self.noise_scale)
        self._clear(CameraClock(self.config.camera_offset, self.config.camera_offset_std))

    def _clear(self, clock: CameraClock) -> None:
        c = self.config
        self._imu = ImuHistory(c.imu_timeout, (c.imu_x, c.imu_y))
        noise = HeadingNoise(c.gyro_noise, c.gyro_drift, c.coasting_yaw_rate, c.imu_timeout)
        self.imu_heading = ImuHeading(noise)
        self.camera_clock = clock
        self._applied, self._jumps = clock.current.offset, 0
        self._raw, self._waiting = deque[RawPose](), deque[RawPose]()  # fused, ahead of the IMU
        self._timeline: Timeline | None = None
        self._candidates, self._repeated = checks.AgreeingPoses(), checks.RepeatedPose()
        self._last_pose_time = self._last_imu_time = self._accepted_at = -math.inf  # s
        self._poses_in_a_row = SILENT_POSES  # without an IMU sample in between
        self._imu_stamps, self._pose_stamps = (
            checks.ImuStamps(c.history),
            checks.PoseStamps(c.history),
        )
        self._models.begin()
        self._filter.model = self._models.current

    def _restart(self) -> None:
        self._clear(self.camera_clock.anew())
        self.counts["restarted"] += 1

    @property
    def applied_offset(self) -> float:
        """What is added to the camera's stamps [s]."""
        return self._applied

    @property
    def motion_model(self) -> MotionModel:
        """The model of the motion that the poses bear out."""
        return self._filter.model

    def add_imu(
        self,
        time: float,
        yaw_rate: float | None,
        forward: float | None,
        left: float | None,
        yaw: float | None = None,
        yaw_std: float | None = None,
    ) -> bool:
        """A sample stamped `time` [s]: gyro [rad/s], specific force [m/s^2], yaw of the orientation [rad].

        None: not measured. False if it was not used. What no fish does is a damaged sample, such as one of a flipped bit:
        it would move a trusted pose, and the camera, which contradicts it, would be refused until reacquire_time.
        """
        if reason := checks.unusable_sample(
            (time, yaw_rate, forward, left, yaw, yaw_std), self.config
        ):
            return self._refuse(reason)
        if self._imu_stamps.set_back(time, self._last_imu_time, self._last_pose_time):
            self._restart()  # as in a restarted simulation
        if reason := self._imu_stamps.refusal(time, self._last_imu_time, self._last_pose_time):
            return self._refuse(reason)
        previous, self._last_imu_time, self._poses_in_a_row = self._last_imu_time, time, 0
        self.counts["imu"] += 1
        step = self.imu_heading.add(time, yaw_rate, yaw, yaw_std or self.config.imu_heading_noise)
        self._imu.add(time, inertial_sample(step, forward, left))
        if self._timeline is not None:
            self._timeline.imu_came(previous)
            self._forget(time)
        history = self.config.history + 2.0 * self.config.imu_timeout
        self._imu.forget(time - max(history, LOOKS_BACK))
        self._fuse_waiting(time + self.config.imu_timeout, imu_lives=True)
        return True

    def add_pose(self, stamp: float, pose: ArrayLike, covariance: Array | None = None) -> bool:
        """A camera pose (x, y, psi) [m, m, rad] with its stamp [s]; False if it was not used."""
        self.refused = ""
        camera = CameraPose(np.array(pose, float), checks.given_covariance(covariance, self.config))
        if reason := checks.unusable(stamp, camera, covariance):
            return self._refuse(reason)
        if any(raw.stamp == stamp for raw in (*self._raw, *self._waiting)):
            return self._refuse("pose_duplicate")
        imu_lives = self._poses_in_a_row < SILENT_POSES
        self._poses_in_a_row += 1
        if imu_lives:
            self._compare_clocks(stamp, camera)
        time = stamp + self._applied
        ahead = time - self._last_imu_time - self.config.imu_timeout
        if imu_lives and ahead > 0.0:
            if ahead > LONGEST_WAIT:
                return self._refuse("pose_from_future")
            self._waiting.append(RawPose(stamp, camera))  # the IMU's samples are still to come
            return False
        if not imu_lives:
            self._fuse_waiting(math.inf, imu_lives)
        if self._pose_stamps.set_back(time, self._last_pose_time, imu_lives):
            self._restart()
        newest = max(self._last_imu_time, self._last_pose_time)
        if self._pose_stamps.from_future(time, newest, imu_lives):
            return self._refuse("pose_from_future")
        return self._take(RawPose(stamp, camera), imu_lives)

    def estimate(self, silence: float = 0.0) -> Estimate | None:
        """State at the newest IMU sample, without an IMU at the newest pose; None before the first.

        silence: s since a measurement was used; with it the sensors' stamps say what is lost. Negative counts as 0.
        """
        if self._timeline is None:
            return None
        now = max(self._last_imu_time, self._timeline.last.time) + max(0.0, silence)
        imu_lost = self.imu_lost(silence)
        # a camera whose clock is a little ahead must not hold the estimate at its stamp until the IMU is there
        time = self._timeline.last.time if imu_lost else self._last_imu_time
        if time < self._timeline.first.time:
            return None
        moment, c = self._timeline.at(time), self.config
        camera_lost = now - self._accepted_at > c.camera_timeout
        std = self.camera_clock.current.std if not imu_lost else c.camera_offset_std
        rate = self._imu.yaw_rate(moment.time)
        return to_estimate(moment, rate, std, c.gyro_noise, camera_lost, imu_lost)

    def imu_lost(self, silence: float = 0.0) -> bool:
        """Whether no IMU sample has come for too long; silence: as for `estimate`."""
        newest = self._last_imu_time if self._timeline is None else self._timeline.last.time
        unheard = max(0.0, newest - self._last_imu_time) + max(0.0, silence)
        return unheard > self.config.imu_timeout

    def _refuse(self, reason: str) -> bool:
        self.counts[reason] += 1
        self.refused = reason
        return False

    def _compare_clocks(self, stamp: float, camera: CameraPose) -> None:
        """Let the estimate of the camera's offset learn; apply it."""
        if not self.config.estimate_offset or not len(self._imu):
            return
        self.camera_clock.add(stamp, float(camera.pose[2]), self._imu, self._last_imu_time)
        offset = self.camera_clock.current.offset
        if self.camera_clock.jumps != self._jumps:  # what came before has another offset
            self._jumps, self._applied = self.camera_clock.jumps, offset
            self._raw, self._waiting = deque(), deque()
        if abs(offset - self._applied) > REFIT:
            self.counts["offset_changed"] += 1
            self._applied = offset
            self._refit()
        self._applied = offset

    def _refit(self) -> None:
        """Fuse the history anew, at the times that the new offset gives; forget biases that wrong times taught."""
        raws = sorted(self._raw, key=lambda raw: raw.stamp)
        if self._timeline is None or not raws:
            return
        self._begin(start_moment(raws[0].stamp + self._applied, raws[0].camera.pose))
        for raw in raws[1:]:
            time = raw.stamp + self._applied
            filter = self._timeline.predict(time)
            camera = self._weighted(raw.camera, time)
            y, S = filter.innovation(camera.pose, camera.R)
            if float(y @ np.linalg.solve(S, y)) <= self.config.gate:
                self._timeline.insert(time, camera)
        self._models.begin(self._timeline.last.time)

    def _take(self, raw: RawPose, imu_lives: bool) -> bool:
        """Start with a pose, or fuse it; False if it was not used."""
        if self._timeline is None:
            return self._start(raw)
        time, newest = raw.stamp + self._applied, max(self._last_imu_time, self._timeline.last.time)
        if time <= max(self._timeline.first.time, newest - self.config.history):
            return self._refuse("pose_too_late")
        if self.camera_clock.undecided and math.hypot(*self._timeline.last.x[3:5]) > SWIMS:
            return self._refuse("pose_clock_undecided")
        return self._fuse(raw, time, imu_lives)

    def _fuse_waiting(self, until: float, imu_lives: bool) -> None:
        """Take the poses that wait for the IMU and were taken up to `until` [s] of its clock."""
        while self._waiting and self._waiting[0].stamp + self._applied <= until:
            self._take(self._waiting.popleft(), imu_lives)

    def _weighted(self, camera: CameraPose, time: float) -> CameraPose:
        """A pose with what makes it uncertain; the filter must hold its prediction for `time` [s]."""
        rate = self._imu.yaw_rate(time) or 0.0
        motion = np.array([*self._filter.x[3:5], rate])
        return checks.weighted(camera, self.noise_scale, self.camera_clock.current, motion)

    def _fuse(self, raw: RawPose, time: float, imu_lives: bool) -> bool:
        assert self._timeline is not None
        pose = raw.camera.pose
        filter = self._timeline.predict(time)
        speed_std = math.sqrt(max(filter.P[3, 3], filter.P[4, 4]))
        yaw = float(self._imu.heading(np.array([time]))[0]) if len(self._imu) else 0.0
        if self._repeated.check(pose, yaw, math.hypot(*filter.x[3:5]), speed_std):
            return self._refuse("pose_repeated")
        self._raw = raw.after(self._raw, self.config.history + self.config.imu_timeout)
        camera = self._weighted(raw.camera, time)
        y, S = filter.innovation(pose, camera.R)
        fits = float(y @ np.linalg.solve(S, y)) <= self.config.gate
        if self.camera_clock.current.sure or not self.camera_clock.contradicted:
            self.noise_scale.learn(y, S)
        if fits:
            self._candidates.clear()
            return self._accept(time, camera)
        known = self.camera_clock.current.sure or not imu_lives
        agree = self._candidates.add(time, pose) >= self.config.start_frames
        if agree and checks.doubts_motion(y, self._candidates.duration, known):
            fade = float(y @ np.linalg.solve(S, y)) / len(y)
            self.counts["motion_doubted"] += 1
            return self._accept(time, camera._replace(fade=fade))
        self.counts["pose_outlier"] += 1
        return agree and self._reacquire(time, pose)

    def _accept(self, time: float, camera: CameraPose) -> bool:
        assert self._timeline is not None
        self._timeline.insert(time, camera)
        self._choose_model(self._timeline)
        self._forget(max(time, self._last_imu_time))
        self._last_pose_time = max(self._last_pose_time, time)
        self._accepted_at = max(time, self._last_imu_time)
        self.counts["pose"] += 1
        return True

    def _choose_model(self, timeline: Timeline) -> None:
        """Let the poses say which model of the motion they bear out."""
        moments = timeline.since(self._models.time)
        swims = math.hypot(*moments[-1].x[3:5]) > SWIMS
        clear = self.camera_clock.current.sure or not self.camera_clock.contradicted
        self._filter.model = self._models.follow(moments, self._imu, clear and swims)

    def _forget(self, now: float) -> None:
        assert self._timeline is not None
        self._timeline.forget(now - self.config.history)
        while self._raw and self._raw[0].stamp + self._applied < now - self.config.history:
            self._raw.popleft()

    def _start(self, raw: RawPose) -> bool:
        """Wait for poses that agree, then begin at rest at the last one."""
        self._raw = raw.after(self._raw, self.config.history + self.config.imu_timeout)
        time = raw.stamp + self._applied
        if self._candidates.add(time, raw.camera.pose) < self.config.start_frames:
            return False
        self.counts["started"] += 1
        return self._begin(start_moment(time, raw.camera.pose))

    def _reacquire(self, time: float, pose: Array) -> bool:
        """Believe poses that contradict the estimate once they have agreed for long enough."""
        assert self._timeline is not None
        if self._candidates.duration < self.config.reacquire_time:
            return False
        self.counts["reacquired"] += 1
        return self._begin(start_moment(time, pose, self._timeline.last))

    def _begin(self, moment: Moment) -> bool:
        self._timeline = Timeline(self._filter, self._imu, moment)
        self._models.begin()
        self._last_pose_time = moment.time
        self._accepted_at = max(moment.time, self._last_imu_time)
        self._candidates.clear()
        return True
