# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which measurements the fusion uses, and how much a camera pose counts.

Refused are IMU samples and poses that no fish can have produced, single wrong stamps, repeats of one picture and poses without a
usable covariance. Stamps of a clock that was set increase among themselves; so they are told from single wrong ones.
A pose counts by its message, the noise that the data show and the camera's clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fish_control.fusion_config import FusionConfig
from fish_control.measurement_buffer import CameraPose
from fish_control.offset_sums import ClockEstimate
from fish_control.strapdown import NoiseScale, pose_residual
from fish_node.pool import FARTHEST

Array = NDArray[np.float64]

ENOUGH = 4  # strange stamps in a row; stragglers are fewer, and not in their own order
FEW_POSES = 3  # the same of a camera's, which come less often


def unusable_sample(values: Sequence[float | None], config: FusionConfig) -> str:
    """Why a sample is used nowhere, as fusion counts it; "" if it is usable.

    Args:
        values: stamp [s], yaw rate [rad/s], specific force ahead and to the left [m/s^2], then others; None: not measured.
    """
    if not all(math.isfinite(v) for v in values if v is not None):
        return "imu_not_finite"
    _, yaw_rate, forward, left, *_ = (v or 0.0 for v in values)
    if math.hypot(forward, left) > config.largest_accel or abs(yaw_rate) > config.largest_yaw_rate:
        return "imu_implausible"
    return ""


FASTEST_SWIM = 0.6  # m/s, poses of one fish are no farther apart
FASTEST_TURN = 4.0  # rad/s
LONGEST_PAUSE = 0.5  # s between two poses that agree
NEAR = (
    0.15,
    0.4,
)  # m, rad, by which poses miss the estimate if its motion is at fault, not the camera
SURPRISING = 0.4  # s, for which they must agree
DOUBTED = 1.2  # rad, by which they may miss it while the camera's clock is not known


class AgreeingPoses:
    """Poses in a row that could be one swimming fish."""

    def __init__(self) -> None:
        self._poses: list[tuple[float, Array]] = []

    def add(self, time: float, pose: Array) -> int:
        """Keep a pose; how many in a row agree, this one included."""
        if self._poses:
            before, previous = self._poses[-1]
            dt = time - before
            apart = np.abs(pose_residual(pose.copy(), previous))
            near = (
                math.hypot(apart[0], apart[1]) <= FASTEST_SWIM * dt + 0.03
                and apart[2] <= FASTEST_TURN * dt + 0.1
            )
            if not (0.0 < dt <= LONGEST_PAUSE and near):
                self._poses.clear()
        self._poses.append((time, pose))
        return len(self._poses)

    @property
    def duration(self) -> float:
        """From the first to the last that agree [s]."""
        return self._poses[-1][0] - self._poses[0][0] if self._poses else 0.0

    def clear(self) -> None:
        """Forget them."""
        self._poses.clear()


class RepeatedPose:
    """Notices a picture that is sent again and again with new stamps: equal to the last digit while the fish moves."""

    SLOWEST = 0.01  # m/s, beyond three standard deviations
    TURN = 0.03  # rad, by which the IMU's heading may wander at rest

    def __init__(self) -> None:
        self._pose: Array | None = None
        self._yaw = 0.0
        self._frozen = False

    def check(self, pose: Array, yaw: float, speed: float, speed_std: float) -> bool:
        """Whether this pose is a frozen picture; yaw: of the IMU [rad], speed and its deviation as estimated [m/s]."""
        if self._pose is None or not np.array_equal(pose, self._pose):
            self._pose, self._yaw, self._frozen = pose.copy(), yaw, False
            return False
        moves = speed > self.SLOWEST + 3.0 * speed_std or abs(yaw - self._yaw) > self.TURN
        self._frozen = self._frozen or moves
        return self._frozen


def doubts_motion(y: Array, duration: float, clock_known: bool) -> bool:
    """Whether poses that agree with each other, but miss the estimate by y (x, y, psi), speak against its motion.

    They do where they have been near it for a `duration` [s], or where the camera's clock is not known: then the swing of
    the head differs, and the accelerations are those of another moment.
    """
    if not clock_known:
        return abs(float(y[2])) < DOUBTED
    near = is_near(y) and abs(float(y[2])) < NEAR[1]
    return near and duration >= SURPRISING


def is_near(y: Array) -> bool:
    """Whether a pose misses the estimate by no more than a wrong motion explains."""
    return math.hypot(y[0], y[1]) < NEAR[0]


ROUNDING = 1e-6  # of the largest element of a covariance; trackers compute in single precision


def not_measured(covariance: Array) -> bool:
    """Whether a variance of a camera pose's (3, 3) covariance, below 0 such as -1, says that a part is not measured."""
    return any(variance < 0.0 for variance in np.diagonal(covariance).tolist())


def given_covariance(covariance: Array | None, config: FusionConfig) -> Array:
    """R (3, 3) of a camera pose: what its message says, or the parameters where a variance is 0 and so says nothing."""
    if covariance is not None:
        R = np.array(covariance, dtype=float)
        if min(R.diagonal().tolist()) > 0.0 or not np.isfinite(R).all():
            return R
    deviations = [config.camera_position_noise] * 2 + [config.camera_heading_noise]
    return np.diag(np.square(deviations))


def unusable(stamp: float, camera: CameraPose, covariance: Array | None) -> str:
    """Why a pose with its own covariance (None: not given) is used nowhere, as fusion counts it; "" if it is usable."""
    if covariance is not None and not_measured(covariance):
        return "pose_not_measured"
    R = camera.R
    if not (math.isfinite(stamp) and np.isfinite(camera.pose).all() and np.isfinite(R).all()):
        return "pose_not_finite"
    if np.abs(camera.pose[:2]).max() > FARTHEST:
        return "pose_implausible"
    tolerance = ROUNDING * float(np.abs(R).max())
    if np.abs(R - R.T).max() > tolerance or not _is_positive(R + tolerance * np.eye(3)):
        return "pose_no_covariance"
    return ""


def _is_positive(R: Array) -> bool:
    """Whether a symmetric (3, 3) matrix has no eigenvalue below zero, by its leading minors (Sylvester)."""
    (a, b, c), (_, d, e), (_, _, f) = R.tolist()
    minor = a * d - b * b
    return bool(
        a >= 0.0 and minor >= 0.0 and f * minor - a * e * e + 2.0 * b * c * e - c * c * d >= 0.0
    )


def weighted(
    camera: CameraPose, scale: NoiseScale, clock: ClockEstimate, motion: Array
) -> CameraPose:
    """The pose with all that makes it uncertain.

    motion: (v_x, v_y, psi') of the fish [m/s, m/s, rad/s], along which a camera's clock that is not known displaces it.
    """
    spread = np.sqrt([scale.position, scale.position, scale.heading])
    R = camera.R * (spread[:, None] * spread)
    if not clock.sure:
        R = R + clock.std**2 * (motion[:, None] * motion)
    return camera._replace(R=R)


class StrangeStamps:
    """Counts strange stamps in a row that increase among themselves.

    Args:
        enough: so many of them are of a clock that was set.
    """

    def __init__(self, enough: int = ENOUGH) -> None:
        self._enough = enough
        self._last, self._count = 0.0, 0

    def add(self, time: float, strange: bool) -> bool:
        """Whether a stamp [s] with those before it says that the clock was set."""
        in_order = self._count > 0 and time > self._last
        self._last = time
        if not strange:
            self._count = 0
        else:
            self._count = self._count + 1 if in_order else 1
        return self._count >= self._enough


class ImuStamps:
    """What the IMU's stamps say of its clock.

    Args:
        history: s, by which a stamp may be ahead of those before it.
    """

    def __init__(self, history: float) -> None:
        self._history = history
        self._back, self._behind, self._ahead = (StrangeStamps() for _ in range(3))

    def set_back(self, time: float, newest: float, newest_pose: float) -> bool:
        """Whether the clock was set back, or the poses had stamps from the future while no IMU said so; all in s."""
        back = self._back.add(time, time <= newest)
        return self._behind.add(time, time < newest_pose - self._history) or back

    def refusal(self, time: float, newest: float, newest_pose: float) -> str:
        """Why a stamp is not used, as fusion counts it; "" if it is usable."""
        if time <= newest:
            return "imu_out_of_order" if time < newest else "imu_duplicate"
        known = math.isfinite(newest)
        far = known and time > max(newest, newest_pose) + self._history
        return "imu_from_future" if not self._ahead.add(time, far) and far else ""


class PoseStamps:
    """What the camera's stamps say of its clock while no IMU does.

    Args:
        history: s, by which a stamp may differ from those before it.
    """

    def __init__(self, history: float) -> None:
        self._history = history
        self._old = 0  # in a row
        self._ahead = StrangeStamps(FEW_POSES)

    def set_back(self, time: float, newest_pose: float, imu_lives: bool) -> bool:
        """Whether the clock was set back; all in s."""
        old = not imu_lives and time < newest_pose - self._history
        self._old = self._old + 1 if old else 0
        return self._old >= FEW_POSES

    def from_future(self, time: float, newest: float, imu_lives: bool) -> bool:
        """Whether a stamp is wrong; newest: of the poses and of the IMU [s], -inf before the first."""
        far = not imu_lives and math.isfinite(newest) and time > newest + self._history
        return not self._ahead.add(time, far) and far
