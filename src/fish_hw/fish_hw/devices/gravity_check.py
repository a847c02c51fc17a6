# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether an IMU's attitude and its accelerometer agree on where up is."""

import math

from fish_hw.devices.imu_sample import ImuSample
from fish_hw.devices.reconnect import Doubt
from fish_hw.devices.rotation import Vector, rotate

STANDARD_GRAVITY = 9.80665  # m/s^2
QUIET = 0.05  # share of 1 g; samples that are further from it say little about where up is
# of quiet samples: a strong sway tilts single ones by 15 deg, its mean stays upright
WINDOW_S = 2.0
LIMIT_DEG = 10.0  # the sensor's worst is 3.5 deg


class GravityCheck:
    """Compares the mean acceleration of quiet windows, turned into the level frame, with the vertical.

    The mounting does not matter: it turns attitude and acceleration alike.
    """

    def __init__(self) -> None:
        self.trouble = ""  # of the newest window
        self._said = False
        self._since_s: float | None = None
        self._sum: Vector = (0.0, 0.0, 0.0)

    def restart(self) -> None:
        """Begin again with a sensor that was started again; what was said is not said again."""
        self.trouble, self._since_s = "", None

    def add(self, sample: ImuSample) -> list[str]:
        """Take a sample; the event, once, if a window ends with which the attitude disagrees."""
        if abs(math.hypot(*sample.acceleration) / STANDARD_GRAVITY - 1.0) > QUIET:
            self._since_s = None
            return []
        if self._since_s is None:
            self._since_s, self._sum = sample.time_s, (0.0, 0.0, 0.0)
        x, y, z = rotate(sample.orientation, sample.acceleration)
        self._sum = (self._sum[0] + x, self._sum[1] + y, self._sum[2] + z)
        if sample.time_s - self._since_s < WINDOW_S:
            return []
        self._since_s = None
        return self._judge()

    def _judge(self) -> list[str]:
        x, y, z = self._sum
        angle = math.degrees(math.atan2(math.hypot(x, y), z))
        if angle <= LIMIT_DEG:
            self.trouble = ""
            return []
        self.trouble = f"attitude and acceleration disagree by {angle:.0f} deg on where up is: roll and pitch are wrong"
        said, self._said = self._said, True
        return [] if said else [Doubt(f"IMU: {self.trouble}")]
