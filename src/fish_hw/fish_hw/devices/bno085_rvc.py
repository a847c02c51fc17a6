# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""BNO085 in its UART-RVC mode: attitude and acceleration at 100 Hz from a serial port, nothing to set.

The datasheet (1000-3927, section 1.3.5.2) contradicts itself on the axes: its text calls pitch the rotation
about Y and roll the one about X, but in its example frame (pitch -1.10 deg, roll 20.85 deg, acceleration
-371, -20, 977 mg) that puts "up" 30.7 deg beside the acceleration, and R_z(yaw) R_x(pitch) R_y(roll) 0.1 deg.
The numbers are followed here. To check them on the bench, tilt the sensor and hold it still, first about one
axis, then about the other: the driver warns when attitude and acceleration disagree. That cannot show the sign
of yaw, which the example leaves open: turn the sensor counter-clockwise, seen from above; yaw must grow.

There is no gyroscope in the stream. The angular velocity is the difference of two attitudes 10 ms apart
(resolution 0.017 rad/s), and the sample is stamped half-way between them.
"""

import time
from collections.abc import Callable

from fish_hw.devices.imu_sample import (
    ImuSample,
    Quaternion,
    from_yaw_pitch_roll,
    mean_rate,
    multiply,
)
from fish_hw.protocol.rvc import FRAME_BYTES, PERIOD_S, RvcMessage, RvcParser
from fish_hw.transport.interfaces import ByteStream

BAUD = 115200
WIRE_S = FRAME_BYTES * 10 / BAUD  # the last byte arrives this long after the hub began
LONGEST_GAP = 3  # frames; over longer ones a difference says little about the rate
FULL_ACCURACY = 3


class Bno085Rvc:
    """Reads samples from a stream that is open."""

    def __init__(self, stream: ByteStream, clock: Callable[[], float] = time.monotonic) -> None:
        self.parser = RvcParser()
        self.lost_frames = 0
        self._stream = stream
        self._clock = clock
        self._last: tuple[int, Quaternion] | None = None

    def poll(self, timeout_s: float) -> list[ImuSample]:
        """Samples in the bytes that arrive within timeout_s; TransportError if the port is gone."""
        messages = self.parser.feed(self._stream.read(timeout_s))
        newest_s = self._clock() - WIRE_S
        samples = []
        for message in messages:
            age = (messages[-1].index - message.index) % 256  # frames, with those that were lost
            sample = self._sample(message, newest_s - age * PERIOD_S)
            if sample is not None:
                samples.append(sample)
        return samples

    def _sample(self, message: RvcMessage, time_s: float) -> ImuSample | None:
        orientation = attitude(message)
        last, self._last = self._last, (message.index, orientation)
        if last is None:
            return None
        frames = (message.index - last[0]) % 256
        self.lost_frames += max(frames - 1, 0)
        if not 1 <= frames <= LONGEST_GAP:
            return None
        dt = frames * PERIOD_S
        rate = mean_rate(last[1], orientation, dt)
        return ImuSample(time_s - dt / 2, orientation, rate, message.acceleration, FULL_ACCURACY)


def attitude(message: RvcMessage) -> Quaternion:
    """Sensor axes to the level frame: R_z(yaw) R_x(pitch) R_y(roll)."""
    return multiply(
        from_yaw_pitch_roll(message.yaw, 0.0, message.pitch),
        from_yaw_pitch_roll(0.0, message.roll, 0.0),
    )
