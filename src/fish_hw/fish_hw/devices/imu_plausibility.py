# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which IMU samples can be used, and whether attitude and acceleration agree on where up is.

Values that stand still, that jump, or that contradict each other are not used. A bit error may leave every value within the
sensor's range, so that only its rate of change betrays it. The fish cannot turn faster than its rotor can: 0.19 N m on
0.0024 kg m^2 are 80 rad/s^2.
"""

import math
from collections import deque
from dataclasses import dataclass

from fish_hw.devices.imu_sample import ImuSample, Vector, mean_rate, rotate
from fish_hw.devices.reconnect import Doubt

LARGEST_TURN_ACCELERATION = 200.0  # rad/s^2, of the gyroscope between two samples
TURN_NOISE = 0.5  # rad/s, allowed on top of it
LARGEST_ACCELERATION_CHANGE = 15.0  # m/s^2 between two samples
LARGEST_TURN = 25.0  # rad/s, of the orientation between two samples
DISAGREEMENT = 3.0  # rad/s between gyroscope and orientation; in strokes they differ by up to 2
WINDOW = 11  # samples over which the two are compared: stamps may be a period late
NEW_LEVEL = 8  # periods; after so long a jump is a new level, unless the two disagree
STANDS_STILL = "values stand still"

STANDARD_GRAVITY = 9.80665  # m/s^2
QUIET = 0.05  # share of 1 g; samples that are further from it say little about where up is
# of quiet samples: a strong sway tilts single ones by 15 deg, its mean stays upright
QUIET_WINDOW_S = 2.0
TILT_LIMIT_DEG = 10.0  # the sensor's worst is 3.5 deg


@dataclass
class ImuRefusals:
    """Samples that were not used since the start."""

    repeated: int = 0
    jumped: int = 0
    contradictory: int = 0


class ImuPlausibility:
    """Judges samples one after the other.

    Attributes:
        trouble: why the newest sample was refused; empty if it is used.
        in_a_row: samples refused since the last one that was used.

    Args:
        period_s: between two samples; stamps jitter, and two that are nearer together are taken as a period apart.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self.in_a_row = 0
        self.refusals = ImuRefusals()
        self.trouble = ""
        self.restart()

    def restart(self) -> None:
        """Begin again with a sensor that was started again."""
        self._last: ImuSample | None = None  # used or not
        self._used: ImuSample | None = None
        self._window: deque[ImuSample] = deque(maxlen=WINDOW)

    def use(self, sample: ImuSample) -> bool:
        """Whether a sample can be used."""
        last, self._last = self._last, sample
        if last is not None and _values(last) == _values(sample):
            self.refusals.repeated += 1
            self.trouble = STANDS_STILL
            self.in_a_row += 1
            return False
        self._window.append(sample)
        self.trouble = self._contradiction() or self._jump(sample)
        self.in_a_row = self.in_a_row + 1 if self.trouble else 0
        if not self.trouble:
            self._used = sample
        return not self.trouble

    def _contradiction(self) -> str:
        """Gyroscope against orientation, over a whole window."""
        if len(self._window) < WINDOW:
            return ""
        first, last = self._window[0], self._window[-1]
        after = list(self._window)[1:]
        mean = [sum(sample.angular_velocity[i] for sample in after) / len(after) for i in range(3)]
        span_s = max(last.time_s - first.time_s, 0.8 * (WINDOW - 1) * self._period_s)
        turned = mean_rate(first.orientation, last.orientation, span_s)
        difference = math.dist(mean, turned)
        if difference <= DISAGREEMENT:
            return ""
        self.refusals.contradictory += 1
        return f"turn rate and orientation disagree by {difference:.1f} rad/s"

    def _jump(self, sample: ImuSample) -> str:
        """Against the sample that was used last; after a window of jumps that agree the new level is taken."""
        used = self._used
        if used is None:
            return ""
        dt = max(sample.time_s - used.time_s, self._period_s)
        change = math.dist(sample.angular_velocity, used.angular_velocity)
        turned = math.hypot(*mean_rate(used.orientation, sample.orientation, dt))
        if change > LARGEST_TURN_ACCELERATION * min(dt, 2 * self._period_s) + TURN_NOISE:
            found = f"turn rate jumped by {change:.1f} rad/s"
        elif math.dist(sample.acceleration, used.acceleration) > LARGEST_ACCELERATION_CHANGE:
            found = "acceleration jumped"
        elif turned > LARGEST_TURN:
            found = "orientation jumped"
        else:
            return ""
        self.refusals.jumped += 1
        return found if dt < NEW_LEVEL * self._period_s else ""


def _values(sample: ImuSample) -> tuple[object, ...]:
    return sample.orientation, sample.angular_velocity, sample.acceleration


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
        if sample.time_s - self._since_s < QUIET_WINDOW_S:
            return []
        self._since_s = None
        return self._judge()

    def _judge(self) -> list[str]:
        x, y, z = self._sum
        angle = math.degrees(math.atan2(math.hypot(x, y), z))
        if angle <= TILT_LIMIT_DEG:
            self.trouble = ""
            return []
        self.trouble = f"attitude and acceleration disagree by {angle:.0f} deg on where up is: roll and pitch are wrong"
        said, self._said = self._said, True
        return [] if said else [Doubt(f"IMU: {self.trouble}")]
