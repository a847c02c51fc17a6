# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""BNO085 on I2C: acceleration, angular velocity and game rotation vector as one sample.

The bus carries no checksum and the hub stretches the clock, so packets arrive damaged: what is not plausible
is dropped and counted, and a bus error while reading counts as "no data". The game rotation vector is used
because the rotor's magnets disturb the compass.

With the hub's interrupt line samples carry the time of the interrupt and the hub is read only when it has
data. Without it the hub is asked once per interval, since a read too many stretches the clock until there is
data, and times are late by up to one interval. Once in EXTRA_READ polls it is asked again all the same, or a
backlog would stay for ever.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from fish_hw.devices.imu_sample import ImuSample, norm
from fish_hw.devices.reconnect import DeviceError
from fish_hw.protocol import sh2
from fish_hw.protocol.sh2 import Cargo, Header, ProductId, Report
from fish_hw.transport.interfaces import DataReady, I2cBus, TransportError

FEATURES = (sh2.ACCELEROMETER, sh2.GYROSCOPE, sh2.GAME_ROTATION_VECTOR)
RESET_WAIT_S = 0.3
START_READS = 40
START_READ_WAIT_S = 0.01
MAX_READS = 8  # packets per poll; one holds all three reports, or three hold one each
EXTRA_READ = 20  # polls
LONGEST_READ = 512  # bytes; longer cargoes come in pieces
MAX_PIECES = 65  # of one cargo: 32766 bytes; more come from a hub, or a bus, that hangs
MAX_ACCELERATION = 136.0  # m/s^2, magnitude; the sensor ends at 8 g per axis
MAX_RATE = 60.5  # rad/s, magnitude; the sensor ends at 2000 deg/s per axis
UNIT_TOLERANCE = 0.02
OLDEST_S, NEWEST_S = (
    1.0,
    0.05,
)  # before and after the read; a bit error in the time base leads anywhere
HINT = "check power, wiring, PS0/PS1 = 00, the address (0x4a or 0x4b) and the bus speed (400 kHz)"
LINE_HINT = "; the hub is read only while int_line is low: check that H_INTN is wired to it"


@dataclass
class BnoCounters:
    """What went wrong since the start."""

    bus_errors: int = 0
    bad_packets: int = 0
    implausible: int = 0
    bad_times: int = 0
    resets: int = 0


class Bno085:
    """One hub at an address.

    start() resets it and switches the reports on; poll() returns the samples that have come since.
    """

    def __init__(
        self,
        bus: I2cBus,
        address: int,
        interval_us: int,
        data_ready: DataReady | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.counters = BnoCounters()
        self.drops = sh2.Drops()
        self.reassembler = sh2.Reassembler()
        self.intervals_us: dict[int, int] = {}  # as the hub really runs them
        self._bus = bus
        self._address = address
        self._interval_us = interval_us
        self._data_ready = data_ready
        self._clock = clock
        self._sleep = sleep
        self._writer = sh2.Writer()
        self._newest: dict[int, Report] = {}
        self._product: ProductId | None = None
        self._restarted = False
        self._polls = 0
        self._read_s = 0.0

    def start(self) -> ProductId:
        """Reset, identify, switch the reports on; DeviceError if no BNO085 answers."""
        try:
            self._send(sh2.EXECUTABLE, sh2.RESET_COMMAND)
            self._sleep(RESET_WAIT_S)
            self.reassembler.reset()
            self._drain()
            self._send(sh2.CONTROL, sh2.product_id_request())
        except TransportError as error:
            raise DeviceError(f"no BNO085 at 0x{self._address:02x}: {error}; {HINT}") from error
        product = self._wait_for_product()
        self._request_features()
        self._restarted = False
        return product

    def poll(self, timeout_s: float = 0.0) -> list[ImuSample]:
        """Samples that have come; with an interrupt line waits for them up to timeout_s."""
        self._polls += 1
        all_there_is = self._data_ready is not None or self._polls % EXTRA_READ == 0
        samples: list[ImuSample] = []
        for _ in range(MAX_READS):
            ready, edge_s = self._wait(timeout_s if not samples else 0.0)
            cargo = self._read_cargo() if ready else None
            if cargo is None:
                break
            samples += self._take(cargo, self._read_s if edge_s is None else edge_s)
            self._repeat_features()
            if samples and not all_there_is:
                break
        return samples

    def _wait(self, timeout_s: float) -> tuple[bool, float | None]:
        """Whether the hub may have data, and since when if that is known."""
        if self._data_ready is None:
            return True, None
        edge_s = self._data_ready.wait(timeout_s)
        return self._data_ready.is_low(), edge_s

    def _repeat_features(self) -> None:
        """After a brown-out the hub has forgotten which reports it should send."""
        if self._restarted:
            self._restarted = False
            self._request_features()

    def _wait_for_product(self) -> ProductId:
        for _ in range(START_READS):
            cargo = self._read_cargo() if self._has_data() else None
            if cargo is not None:
                self._take(cargo, self._read_s)
            if self._product is not None:
                return self._product
            self._sleep(START_READ_WAIT_S)
        raise DeviceError(
            f"no BNO085 answers at 0x{self._address:02x} ({self.counters.bus_errors} bus errors,"
            f" {self.counters.bad_packets} bad packets); {HINT}{'' if self._data_ready is None else LINE_HINT}"
        )

    def _drain(self) -> None:
        """Read what the hub says about its reset."""
        for _ in range(START_READS):
            cargo = self._read_cargo() if self._has_data() else None
            if cargo is None:
                return
            self._take(cargo, self._read_s)

    def _has_data(self) -> bool:
        """Whether the hub may be read; a read while its line is high stretches the clock."""
        return self._data_ready is None or self._data_ready.is_low()

    def _request_features(self) -> None:
        self._newest.clear()
        for report_id in FEATURES:
            self._send(sh2.CONTROL, sh2.set_feature(report_id, self._interval_us))

    def _send(self, channel: int, payload: bytes) -> None:
        self._bus.write(self._address, self._writer.frame(channel, payload))

    def _take(self, cargo: Cargo, time_s: float) -> list[ImuSample]:
        if cargo.channel in (sh2.REPORTS, sh2.WAKE_REPORTS):
            return self._take_reports(cargo.payload, time_s)
        if cargo.channel == sh2.EXECUTABLE and cargo.payload == sh2.RESET_COMPLETE:
            self._restarted = True  # after start() this means a brown-out: the reports are off now
            self.counters.resets += 1
            self.reassembler.reset()
        if cargo.channel == sh2.CONTROL:
            self._product = sh2.parse_product_id(cargo.payload) or self._product
            self._note_feature(cargo.payload)
        return []

    def _note_feature(self, payload: bytes) -> None:
        feature = sh2.parse_feature_response(payload)
        if feature is not None:
            self.intervals_us[feature[0]] = feature[1]

    def _take_reports(self, payload: bytes, time_s: float) -> list[ImuSample]:
        samples = []
        for report in sh2.parse_reports(payload, time_s, self.drops):
            if report.id not in FEATURES:
                continue
            if not plausible(report):
                self.counters.implausible += 1
                continue
            if not -OLDEST_S <= report.time_s - time_s <= NEWEST_S:
                self.counters.bad_times += 1
                continue
            self._newest[report.id] = report
            if len(self._newest) == len(FEATURES):
                samples.append(self._assemble())
        return samples

    def _assemble(self) -> ImuSample:
        """One sample of the three newest reports, stamped as the gyroscope's; each report is used once."""
        gyro = self._newest[sh2.GYROSCOPE]
        x, y, z, w = self._newest[sh2.GAME_ROTATION_VECTOR].values
        ax, ay, az = self._newest[sh2.ACCELEROMETER].values
        accuracy = min(report.accuracy for report in self._newest.values())
        self._newest.clear()
        gx, gy, gz = gyro.values
        return ImuSample(gyro.time_s, (x, y, z, w), (gx, gy, gz), (ax, ay, az), accuracy)

    def _read_cargo(self) -> Cargo | None:
        """Next complete cargo, or None if the hub has none, or sent something unreadable."""
        for _ in range(MAX_PIECES):
            header = self._read_header()
            if header is None or header.empty:
                return None
            body = self._read_body(header)
            cargo = None if body is None else self.reassembler.feed(header, body)
            if cargo is not None or body is None:
                return cargo
        self.counters.bad_packets += 1
        return None

    def _read_header(self) -> Header | None:
        data = self._read(sh2.HEADER_BYTES)
        self._read_s = (
            self._clock()
        )  # after the read: the hub may have stretched it until it had data
        if data is None:
            return None
        header = sh2.parse_header(data)
        self.counters.bad_packets += header is None
        return header

    def _read_body(self, header: Header) -> bytes | None:
        """Payload of a packet; the hub repeats the header, which must agree with the one read before."""
        data = self._read(min(header.length, LONGEST_READ))
        if data is None:
            return None
        repeated = sh2.parse_header(data)
        if repeated is None or (repeated.length, repeated.channel) != (
            header.length,
            header.channel,
        ):
            self.counters.bad_packets += 1
            return None
        return data[sh2.HEADER_BYTES :]

    def _read(self, count: int) -> bytes | None:
        try:
            return self._bus.read(self._address, count)
        except TransportError:
            self.counters.bus_errors += 1
            return None


def plausible(report: Report) -> bool:
    """Whether a report can be a measurement: unit quaternion, values within the sensor's range."""
    if report.id == sh2.GAME_ROTATION_VECTOR:
        x, y, z, w = report.values
        return abs(norm((x, y, z, w)) - 1.0) <= UNIT_TOLERANCE
    limit = MAX_ACCELERATION if report.id == sh2.ACCELEROMETER else MAX_RATE
    return math.hypot(*report.values) <= limit
