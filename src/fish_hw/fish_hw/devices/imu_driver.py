# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The IMU as a whole: sensor by I2C or serial, mounting, watchdog, and finding it again after it was lost."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from fish_hw.devices.bno085 import Bno085
from fish_hw.devices.bno085_rvc import Bno085Rvc
from fish_hw.devices.imu_plausibility import STANDS_STILL, GravityCheck, ImuPlausibility
from fish_hw.devices.imu_sample import ImuSample, Mounting
from fish_hw.devices.reconnect import ERROR, OK, WARN, DeviceError, Doubt, Link, Status
from fish_hw.protocol.rvc import PERIOD_S
from fish_hw.settings import ImuSettings
from fish_hw.transport.interfaces import ByteStream, DataReady, I2cBus, TransportError

UNRELIABLE = 0
DOUBTFUL = 3  # refused samples in a row that are worth a line of the log
DOUBT_AGAIN_S = 10.0  # s between two lines of the log about samples that are not used
LEAST_STEP_S = 1e-4  # the sensor's own tick
SLOWEST_RATE, FASTEST_RATE = 0.9, 2.1  # of the asked rate, SH-2 manual


@dataclass
class ImuCycle:
    """What one step brought."""

    samples: list[ImuSample] = field(default_factory=list)
    events: list[str] = field(default_factory=list)


class I2cSensor:
    """A Bno085 with the bus it opens and closes."""

    def __init__(
        self,
        settings: ImuSettings,
        open_bus: Callable[[], I2cBus],
        open_line: Callable[[], DataReady | None],
        clock: Callable[[], float],
        sleep: Callable[[float], None],
    ) -> None:
        self.rate_hz = settings.rate_hz
        self._bus = open_bus()
        self._line: DataReady | None = None
        interval_us = round(1e6 / settings.rate_hz)
        try:
            self._line = open_line()
            self._bno = Bno085(self._bus, settings.address, interval_us, self._line, clock, sleep)
            self.name = str(self._bno.start())
        except (TransportError, DeviceError):
            self.close()
            raise

    def poll(self, timeout_s: float) -> list[ImuSample]:
        """Samples since the last call; waits for them only with an interrupt line."""
        return self._bno.poll(timeout_s)

    def close(self) -> None:
        """Give bus and line back."""
        self._bus.close()
        if self._line is not None:
            self._line.close()

    def counters(self) -> dict[str, object]:
        """What went wrong since the start, and the real rates."""
        bno = self._bno
        return {
            **vars(bno.counters),
            **vars(bno.drops),
            "sequence gaps": bno.reassembler.sequence_gaps,
            "orphan fragments": bno.reassembler.orphans,
            "intervals [us]": dict(bno.intervals_us),
        }


class SerialSensor:
    """A Bno085Rvc with the port it opens and closes."""

    name = "UART-RVC"
    rate_hz = 1.0 / PERIOD_S  # whatever the settings ask for

    def __init__(self, open_stream: Callable[[], ByteStream], clock: Callable[[], float]) -> None:
        self._stream = open_stream()
        self._bno = Bno085Rvc(self._stream, clock)

    def poll(self, timeout_s: float) -> list[ImuSample]:
        """Samples that arrive within timeout_s."""
        return self._bno.poll(timeout_s)

    def close(self) -> None:
        """Give the port back."""
        self._stream.close()

    def counters(self) -> dict[str, object]:
        """What went wrong since the start."""
        parser = self._bno.parser
        return {
            "lost frames": self._bno.lost_frames,
            "checksum errors": parser.checksum_errors,
            "skipped bytes": parser.skipped_bytes,
        }


class ImuDriver:
    """Delivers samples in base_link axes; starts the sensor again when it is silent or its values stand
    still.
    """

    def __init__(
        self,
        settings: ImuSettings,
        open_bus: Callable[[], I2cBus],
        open_line: Callable[[], DataReady | None],
        open_stream: Callable[[], ByteStream],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.samples = 0
        self._settings = settings
        self._open_bus, self._open_line, self._open_stream = open_bus, open_line, open_stream
        self._clock, self._sleep = clock, sleep
        self._mounting = Mounting(settings)
        self._sensor: I2cSensor | SerialSensor | None = None
        self._link = Link("IMU")
        self._last: ImuSample | None = None
        self._upright = GravityCheck()
        self._plausibility = ImuPlausibility(1.0 / settings.rate_hz)
        self._doubted_s = -math.inf  # when a doubt was said last
        self._changed_time = self._sample_time = 0.0
        self._newest_s = -math.inf
        self._rated = (0, clock())

    @property
    def connected(self) -> bool:
        """Whether the device is open."""
        return self._sensor is not None

    def connect(self) -> None:
        """Start the sensor; PortUnavailable, TransportError or DeviceError if it cannot."""
        if self._settings.interface == "i2c":
            self._sensor = I2cSensor(
                self._settings, self._open_bus, self._open_line, self._clock, self._sleep
            )
        else:
            self._sensor = SerialSensor(self._open_stream, self._clock)
        self._changed_time = self._sample_time = self._clock()
        self._last = None
        self._upright.restart()
        self._plausibility.restart()
        self._newest_s = -math.inf
        self._rated = (self.samples, self._clock())

    def step(self, timeout_s: float) -> ImuCycle:
        """Read once; waits up to timeout_s for bytes, the interrupt, or the time to try again."""
        now = self._clock()
        try:
            if self._sensor is None:
                return self._reconnect(now, timeout_s)
            samples = [
                self._in_order(self._mounting.to_base(s)) for s in self._sensor.poll(timeout_s)
            ]
            events = self._watch(samples)
            return ImuCycle(
                [s for s in samples if self._plausibility.use(s)], events + self._doubt()
            )
        except (TransportError, DeviceError) as error:
            self.close()
            return ImuCycle(events=self._link.lose(str(error), now))

    def close(self) -> None:
        """Give the port back."""
        if self._sensor is not None:
            self._sensor.close()
        self._sensor = None

    def status(self) -> Status:
        """State in one line with counters and the rate since the last call."""
        rate = self._rate()
        values: dict[str, object] = {
            "samples": self.samples,
            "reconnect attempts": self._link.attempts,
        }
        sensor = self._sensor
        if sensor is None:
            return Status(ERROR, self._link.trouble, values)
        refused = {f"{name} samples": n for name, n in vars(self._plausibility.refusals).items()}
        values |= {
            "sensor": sensor.name,
            "rate [Hz]": round(rate, 1),
            **sensor.counters(),
            **refused,
        }
        if rate == 0.0:
            return Status(ERROR, "no samples", values)
        if self._plausibility.trouble:
            return Status(ERROR, f"samples are not used: {self._plausibility.trouble}", values)
        if self._last is not None and self._last.accuracy == UNRELIABLE:
            return Status(WARN, "the sensor calls its values unreliable", values)
        if self._upright.trouble:
            return Status(WARN, self._upright.trouble, values)
        if not SLOWEST_RATE * sensor.rate_hz <= rate <= FASTEST_RATE * sensor.rate_hz:
            return Status(WARN, f"{rate:.0f} samples/s instead of {sensor.rate_hz:.0f}", values)
        return Status(OK, f"{rate:.0f} samples/s", values)

    def _doubt(self) -> list[str]:
        """The event of samples that are not used, at most one in DOUBT_AGAIN_S; _watch says that values stand still."""
        check, now = self._plausibility, self._clock()
        trouble = check.trouble
        lasts = check.in_a_row >= DOUBTFUL and trouble != STANDS_STILL
        if not lasts or now - self._doubted_s < DOUBT_AGAIN_S:
            return []
        self._doubted_s = now
        return [Doubt(f"IMU: {trouble}: not used")]

    def _in_order(self, sample: ImuSample) -> ImuSample:
        """The sample, later than the one before: a delayed read makes times jitter by some milliseconds."""
        sample = replace(sample, time_s=max(sample.time_s, self._newest_s + LEAST_STEP_S))
        self._newest_s = sample.time_s
        return sample

    def _rate(self) -> float:
        """Samples per second since the last call."""
        now, (samples, since) = self._clock(), self._rated
        self._rated = (self.samples, now)
        return (self.samples - samples) / max(now - since, 1e-3)

    def _watch(self, samples: list[ImuSample]) -> list[str]:
        """Raise when the sensor is silent or frozen; the sensor works once its values change."""
        events: list[str] = []
        for sample in samples:
            last, self._last = self._last, sample
            values = (sample.orientation, sample.angular_velocity, sample.acceleration)
            if last is None:
                self._changed_time = self._clock()
            elif values != (last.orientation, last.angular_velocity, last.acceleration):
                self._changed_time = self._clock()
                events += self._link.works()
            events += self._upright.add(sample)
        self.samples += len(samples)
        now = self._clock()
        if samples:
            self._sample_time = now
        silence = now - self._changed_time
        if silence > self._settings.watchdog_s:
            # neither the poll that notices nor two equal samples before a silence may decide what it is called
            what = "values stand still" if now - self._sample_time < silence / 2 else "no samples"
            raise DeviceError(f"IMU: {what} for {self._settings.watchdog_s} s")
        return events

    def _reconnect(self, now: float, timeout_s: float) -> ImuCycle:
        if self._link.due(now):
            self.connect()
        else:
            self._sleep(timeout_s)
        return ImuCycle()
