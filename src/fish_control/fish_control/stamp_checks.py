# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stamps of a clock that was set, told from single wrong ones: those of a set clock increase among themselves."""

from __future__ import annotations

import math

ENOUGH = 4  # strange stamps in a row; stragglers are fewer, and not in their own order
FEW_POSES = 3  # the same of a camera's, which come less often


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
