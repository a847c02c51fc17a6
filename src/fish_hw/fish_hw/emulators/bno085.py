# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A BNO085 at the level of its I2C messages: advertisement, product id, features, reports, damage on request.

By itself the sensor turns about its z axis: yaw rate 0.5 cos(2 pi 0.2 Hz t) rad/s, plus seeded noise on the
accelerometer. FedBno085 measures what it is given: the simulator's IMU behind the hub's protocol.
"""

import math
import random
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from fish_hw.devices.imu_sample import Quaternion, Vector
from fish_hw.emulators import int16
from fish_hw.protocol import sh2

STANDARD_GRAVITY = 9.80665  # m/s^2
YAW_RATE = 0.5  # rad/s
YAW_FREQUENCY = math.tau * 0.2  # rad/s
PRODUCT_ID = bytes.fromhex("f8010302 98a49800 72010000 0700 0000")
ADVERTISEMENT = bytes(range(1, 9)) * 34  # 272 bytes; what they say does not matter to the driver
UNSOLICITED_INIT = bytes([sh2.COMMAND_RESPONSE, 0, 0x84]) + bytes(13)
NOTHING = bytes(sh2.HEADER_BYTES)

BACKLOG = 10  # measurements that a driver which lags may still read


class Bno085Emulator:
    """Answers plain reads and writes; repeats the header as the hub does, cuts long cargoes as the reader
    asks.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, seed: int = 0) -> None:
        self.written: list[bytes] = []
        self.intervals_us: dict[int, int] = {}
        self.frozen = False
        self.damage: Callable[[bytes], bytes] = lambda packet: (
            packet
        )  # a test's way to break packets
        self._clock = clock
        self._random = random.Random(seed)
        self._queue: deque[tuple[int, bytes]] = deque()
        self._sequence = [0] * 6
        self._report_sequence = 0
        self._started = self._due = clock()
        self._open: tuple[int, int, bytes, bool] | None = (
            None  # channel, sequence, rest, continuation
        )
        self._values: tuple[float, float, tuple[float, float, float]] = (
            0.0,
            0.0,
            (0.0, 0.0, STANDARD_GRAVITY),
        )

    def reset(self) -> None:
        """What happens at power-on and after a brown-out: reports off, three announcements."""
        self.intervals_us.clear()
        self._open = None
        self._queue.clear()
        self._sequence = [0] * 6
        self.push(sh2.COMMAND, ADVERTISEMENT)
        self.push(sh2.EXECUTABLE, sh2.RESET_COMPLETE)
        self.push(sh2.CONTROL, UNSOLICITED_INIT)

    def push(self, channel: int, payload: bytes) -> None:
        """Queue a cargo for the reader."""
        self._queue.append((channel, payload))

    def write(self, data: bytes) -> None:
        """One packet from the host."""
        self.written.append(bytes(data))
        channel, payload = data[2], bytes(data[sh2.HEADER_BYTES :])
        if channel == sh2.EXECUTABLE and payload == sh2.RESET_COMMAND:
            self.reset()
        elif payload[:1] == bytes([sh2.PRODUCT_ID_REQUEST]):
            self.push(sh2.CONTROL, PRODUCT_ID)
        elif payload[:1] == bytes([sh2.SET_FEATURE]):
            self._set_feature(payload)

    def read(self, count: int) -> bytes:
        """The first bytes of the packet at hand; taking more than the header consumes what was read."""
        if self._open is None:
            self._open = self._next_packet()
        if self._open is None:
            return NOTHING.ljust(count, b"\0")
        channel, sequence, rest, continuation = self._open
        length = sh2.HEADER_BYTES + len(rest) | (sh2.CONTINUATION if continuation else 0)
        packet = struct.pack("<HBB", length, channel, sequence) + rest
        if count > sh2.HEADER_BYTES:
            left = rest[count - sh2.HEADER_BYTES :]
            self._open = (channel, sequence, left, True) if left else None
        return self.damage(packet[:count].ljust(count, b"\0"))

    def _next_packet(self) -> tuple[int, int, bytes, bool] | None:
        self._measure()
        if not self._queue:
            return None
        channel, payload = self._queue.popleft()
        sequence = self._sequence[channel]
        self._sequence[channel] = (sequence + 1) & 0xFF
        return channel, sequence, payload, False

    def _set_feature(self, payload: bytes) -> None:
        report_id, _, _, interval_us = struct.unpack("<BBHI", payload[1:9])
        self.intervals_us[report_id] = interval_us
        self._due = self._clock()
        self.push(sh2.CONTROL, bytes([sh2.FEATURE_RESPONSE]) + payload[1:])

    def _measure(self) -> None:
        """One cargo with all reports that are on, whenever their interval is over."""
        now = self._clock()
        if not self.intervals_us or now < self._due:
            return
        interval_s = max(self.intervals_us.values()) * 1e-6
        missed = math.floor((now - self._due) / interval_s)
        taken = self._due + missed * interval_s
        self._due = taken + interval_s
        if not self.frozen:
            self._values = self._motion(taken - self._started)
        ticks = round((now - taken) / sh2.TICK_S)
        reports = b"".join(self._report(report_id) for report_id in sorted(self.intervals_us))
        self.push(sh2.REPORTS, struct.pack("<Bi", sh2.BASE_TIMESTAMP, ticks) + reports)

    def _motion(self, t: float) -> tuple[float, float, tuple[float, float, float]]:
        """Yaw [rad], yaw rate [rad/s], specific force [m/s^2]."""
        yaw = YAW_RATE / YAW_FREQUENCY * math.sin(YAW_FREQUENCY * t)
        x, y, z = (self._random.gauss(0.0, 0.05) for _ in range(3))
        return yaw, YAW_RATE * math.cos(YAW_FREQUENCY * t), (x, y, STANDARD_GRAVITY + z)

    def _values_of(self, report_id: int) -> tuple[float, ...]:
        yaw, rate, acceleration = self._values
        return {
            sh2.ACCELEROMETER: acceleration,
            sh2.GYROSCOPE: (0.0, 0.0, rate),
            sh2.GAME_ROTATION_VECTOR: (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
        }[report_id]

    def _report(self, report_id: int) -> bytes:
        values = self._values_of(report_id)
        scale = 1 << sh2.LAYOUTS[report_id].q
        self._report_sequence = (self._report_sequence + 1) & 0xFF
        head = bytes([report_id, self._report_sequence, 3, 0])
        return head + struct.pack(
            f"<{len(values)}h", *(int16(round(value * scale)) for value in values)
        )


@dataclass(frozen=True)
class Felt:
    """One measurement in the sensor's axes: rad/s, m/s^2, s of the monotonic clock."""

    time_s: float
    orientation: Quaternion
    angular_velocity: Vector
    acceleration: Vector

    @property
    def finite(self) -> bool:
        """Whether every number is one."""
        return all(
            map(math.isfinite, (*self.orientation, *self.angular_velocity, *self.acceleration))
        )


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
        """Take a measurement, if its numbers are finite; called from another thread than the reads."""
        altered = self.alter(felt)
        if altered is not None and altered.finite:
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
            self.push(sh2.REPORTS, struct.pack("<Bi", sh2.BASE_TIMESTAMP, ticks) + reports)

    def _values_of(self, report_id: int) -> tuple[float, ...]:
        return {
            sh2.ACCELEROMETER: self._now.acceleration,
            sh2.GYROSCOPE: self._now.angular_velocity,
            sh2.GAME_ROTATION_VECTOR: self._now.orientation,
        }[report_id]
