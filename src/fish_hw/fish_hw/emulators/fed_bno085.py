# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A BNO085 that measures what it is given: the simulator's IMU behind the hub's protocol."""

import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from fish_hw.devices.rotation import Quaternion, Vector
from fish_hw.emulators.bno085 import Bno085Emulator
from fish_hw.protocol import sh2, shtp

BACKLOG = 10  # measurements that a driver which lags may still read


@dataclass(frozen=True)
class Felt:
    """One measurement in the sensor's axes: rad/s, m/s^2, s of the monotonic clock."""

    time_s: float
    orientation: Quaternion
    angular_velocity: Vector
    acceleration: Vector


class FedBno085(Bno085Emulator):
    """Reports every measurement once, with its age at the moment of the read.

    `alter` is a test's way to falsify measurements; None holds one back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(clock)
        self.alter: Callable[[Felt], Felt | None] = lambda felt: felt
        self._felt: deque[Felt] = deque(maxlen=BACKLOG)
        self._now = Felt(clock(), (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._guard = threading.Lock()

    def feel(self, felt: Felt) -> None:
        """Take a measurement; called from another thread than the reads."""
        altered = self.alter(felt)
        if altered is not None:
            with self._guard:
                self._felt.append(altered)

    def _measure(self) -> None:
        if not self.intervals_us:
            return
        with self._guard:
            waiting, self._felt = list(self._felt), deque(maxlen=BACKLOG)
        for self._now in waiting:
            ticks = round((self._clock() - self._now.time_s) / sh2.TICK_S)
            reports = b"".join(self._report(report_id) for report_id in sorted(self.intervals_us))
            self.push(shtp.REPORTS, struct.pack("<Bi", sh2.BASE_TIMESTAMP, ticks) + reports)

    def _values_of(self, report_id: int) -> tuple[float, ...]:
        return {
            sh2.ACCELEROMETER: self._now.acceleration,
            sh2.GYROSCOPE: self._now.angular_velocity,
            sh2.GAME_ROTATION_VECTOR: self._now.orientation,
        }[report_id]
