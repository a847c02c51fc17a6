# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Camera poses that may not be what they seem: repeats of one picture, and poses that contradict the estimate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fish_control.strapdown import pose_residual

Array = NDArray[np.float64]
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
