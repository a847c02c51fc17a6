# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The BNO085 device and the IMU driver on the emulated hub, on simulated time, with every kind of damage."""

import errno
import itertools
import math
import random
import struct
from dataclasses import replace

import numpy as np
import pytest
from fakes import RecordedStream

from fish_hw.devices import bno085
from fish_hw.devices.bno085 import Bno085
from fish_hw.devices.bno085_rvc import Bno085Rvc, attitude
from fish_hw.devices.imu_driver import ImuDriver
from fish_hw.devices.imu_sample import conjugate, rotate
from fish_hw.devices.reconnect import ERROR, OK, WARN, DeviceError, Doubt, Loss
from fish_hw.emulators.bno085 import YAW_FREQUENCY, YAW_RATE, Bno085Emulator
from fish_hw.emulators.i2c_bus import I2cBusEmulator
from fish_hw.protocol import rvc, sh2
from fish_hw.settings import ImuSettings
from fish_hw.transport.interfaces import PortUnavailable, TransportError

INTERVAL_S = 0.01


class Bench:
    """Hub, bus and device on one simulated clock."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.hub = Bno085Emulator(clock=self.clock)
        self.bus = I2cBusEmulator({0x4A: self.hub})
        self.bno = Bno085(
            self.bus, 0x4A, round(1e6 * INTERVAL_S), clock=self.clock, sleep=self.sleep
        )

    def clock(self) -> float:
        return self.now

    def sleep(self, duration_s: float) -> None:
        self.now += duration_s

    def run(self, duration_s: float) -> list:
        samples = []
        for _ in range(round(duration_s / INTERVAL_S)):
            self.sleep(INTERVAL_S)
            samples += self.bno.poll()
        return samples


@pytest.fixture
def bench():
    bench = Bench()
    bench.bno.start()
    return bench


def test_start_switches_the_reports_on_once(bench):
    assert bench.hub.intervals_us == {1: 10000, 2: 10000, 8: 10000}
    assert bench.hub.written[0] == bytes.fromhex("05 00 01 00 01")
    bench.run(0.1)
    assert len(bench.hub.written) == 5  # reset, product id, three features


def test_samples_have_the_motion_of_the_hub_at_the_time_it_was_measured(bench):
    started = bench.hub._started
    samples = bench.run(3.0)
    assert len(samples) >= 295
    samples = samples[bno085.EXTRA_READ :]  # until then the answers to start() are a backlog of one
    for sample in samples:
        phase = YAW_FREQUENCY * (sample.time_s - started)
        yaw = YAW_RATE / YAW_FREQUENCY * math.sin(phase)
        assert sample.angular_velocity == pytest.approx(
            (0.0, 0.0, YAW_RATE * math.cos(phase)), abs=4e-3
        )
        assert sample.orientation == pytest.approx(
            (0, 0, math.sin(yaw / 2), math.cos(yaw / 2)), abs=1e-3
        )
    assert bench.bno.intervals_us == {1: 10000, 2: 10000, 8: 10000}


def test_backlog_does_not_stay(bench):
    for _ in range(5):
        bench.sleep(INTERVAL_S)
        bench.hub._measure()
    assert len(bench.hub._queue) >= 5
    bench.run(0.5)
    assert len(bench.hub._queue) <= 1


class Line:
    """An interrupt line that fell `age_s` ago, low as long as the hub has something."""

    def __init__(self, bench: Bench, age_s: float) -> None:
        self.bench, self.age_s = bench, age_s
        self.waited, self.closed = [], False

    def wait(self, timeout_s: float) -> float | None:
        self.waited.append(timeout_s)
        return self.bench.now - self.age_s

    def is_low(self) -> bool:
        self.bench.hub._measure()
        return bool(self.bench.hub._queue or self.bench.hub._open)

    def close(self) -> None:
        self.closed = True


def test_interrupt_line_gives_the_time_and_spares_empty_reads():
    bench = Bench()
    line = Line(bench, age_s=0.004)
    bench.bno = Bno085(bench.bus, 0x4A, 10000, line, bench.clock, bench.sleep)
    bench.bno.start()
    reads = []
    read = bench.bus.read
    bench.bus.read = lambda address, count: reads.append(read(address, count)) or reads[-1]
    plain = Bench()
    plain.bno.start()
    samples, without = bench.run(0.5), plain.run(0.5)
    assert len(samples) >= 45
    assert not any(data == bytes(4) for data in reads)
    assert (
        max(len(data) for data in reads) < 64
    )  # what there is, no more: 40 bytes take a millisecond
    assert without[-1].time_s - samples[-1].time_s == pytest.approx(0.004, abs=1e-6)


def test_start_reads_only_while_the_interrupt_line_is_low():
    bench = Bench()
    line = Line(bench, age_s=0.0)
    read, high = bench.bus.read, []

    def watched(address: int, count: int) -> bytes:
        if not line.is_low():
            high.append(count)
        return read(address, count)

    bench.bus.read = watched
    bench.bno = Bno085(bench.bus, 0x4A, 10000, line, bench.clock, bench.sleep)
    bench.bno.start()
    assert high == []


def test_a_line_that_is_never_low_is_named_and_nothing_is_read():
    bench = Bench()
    line = Line(bench, age_s=0.0)
    line.is_low = lambda: False  # H_INTN is wired to another line
    bench.bus.read = lambda address, count: pytest.fail("read while the line is high")
    bench.bno = Bno085(bench.bus, 0x4A, 10000, line, bench.clock, bench.sleep)
    with pytest.raises(DeviceError, match="check that H_INTN is wired"):
        bench.bno.start()


def test_a_poll_waits_for_the_interrupt_until_there_is_a_sample():
    bench = Bench()
    line = Line(bench, age_s=0.0)
    bench.bno = Bno085(bench.bus, 0x4A, 10000, line, bench.clock, bench.sleep)
    bench.bno.start()
    bench.run(0.1)
    line.waited.clear()
    bench.sleep(INTERVAL_S)
    assert len(bench.bno.poll(0.02)) == 1
    assert line.waited == [0.02, 0.0]  # then takes what else is there


def test_long_cargo_comes_in_pieces(bench, monkeypatch):
    bench.run(0.1)
    monkeypatch.setattr(bno085, "LONGEST_READ", 20)
    read, sizes = bench.bus.read, []
    bench.bus.read = lambda address, count: sizes.append(count) or read(address, count)
    samples = bench.run(0.5)  # reports are 43 bytes: three pieces
    assert len(samples) >= 45
    assert max(sizes) == 20
    assert bench.bno.counters.bad_packets == 0
    assert bench.bno.reassembler.orphans == bench.bno.reassembler.sequence_gaps == 0


def test_one_bus_error_costs_one_poll(bench):
    bench.run(0.1)
    codes = iter([errno.EREMOTEIO])
    bench.bus.fault = lambda: next(codes, None)
    assert len(bench.run(0.3)) >= 27
    assert bench.bno.counters.bus_errors == 1


@pytest.mark.parametrize("code", [errno.EREMOTEIO, errno.ETIMEDOUT, errno.EIO])
def test_bus_errors_for_ever_are_no_data(bench, code):
    bench.bus.fault = lambda: code
    assert bench.run(0.3) == []
    assert bench.bno.counters.bus_errors == 30


@pytest.mark.parametrize(
    ("damage", "counter"),
    [
        (lambda p: b"\xff" * len(p), "bad_packets"),
        (lambda p: p[:2] + b"\x06" + p[3:], "bad_packets"),
        (lambda p: p if len(p) <= 4 else b"\x05\x00" + p[2:], "bad_packets"),
    ],
    ids=["all ones", "channel 6", "length changes between header and packet"],
)
def test_damaged_packets_are_dropped_and_it_goes_on(bench, damage, counter):
    bench.run(0.1)
    bench.hub.damage = damage
    assert bench.run(0.3) == []
    assert getattr(bench.bno.counters, counter) > 0
    bench.hub.damage = lambda packet: packet
    assert len(bench.run(0.3)) >= 25


def test_lost_first_bit_of_the_time_base(bench):
    bench.run(0.1)
    bench.hub.damage = lambda p: p[:4] + p[4:].replace(b"\xfb", b"\x7b", 1)
    assert bench.run(0.3) == []
    assert bench.bno.drops.unknown_reports >= 28


def test_implausible_values_are_dropped(bench):
    bench.run(0.1)
    base = b"\xfb\x00\x00\x00\x00"
    bench.hub.push(
        sh2.REPORTS, base + bytes.fromhex("08 00 03 00 ff 7f ff 7f ff 7f ff 7f")
    )  # |q| = 4
    bench.hub.push(sh2.REPORTS, base + bytes.fromhex("01 00 03 00 ff 7f ff 7f ff 7f"))  # 22 g
    bench.hub.push(sh2.REPORTS, base + bytes.fromhex("02 00 03 00 ff 7f ff 7f ff 7f"))  # 6350 deg/s
    bench.run(0.1)
    assert bench.bno.counters.implausible == 3


@pytest.mark.parametrize(
    ("report_id", "largest"),
    [(sh2.ACCELEROMETER, 8 * 9.80665), (sh2.GYROSCOPE, math.radians(2000.0))],
)
def test_whatever_the_sensor_can_measure_is_plausible_and_hardly_more(report_id, largest):
    for factor in (-1.05, -1.0, 1.0, 1.05):
        report = sh2.Report(report_id, 0, 3, 0.0, (factor * largest,) * 3)
        assert bno085.plausible(report) == (abs(factor) == 1.0)


@pytest.mark.parametrize(
    ("length", "expected"), [(0.97, False), (0.985, True), (1.015, True), (1.03, False)]
)
def test_a_rotation_is_plausible_near_unit_length(length, expected):
    values = (0.5 * length, -0.5 * length, 0.5 * length, -0.5 * length)
    assert bno085.plausible(sh2.Report(sh2.GAME_ROTATION_VECTOR, 0, 3, 0.0, values)) == expected


def flip_in_time_base(byte: int, mask: int):
    """Damage: bits of one byte of every time base."""

    def damage(packet: bytes) -> bytes:
        if len(packet) <= 9 or packet[2] != sh2.REPORTS or packet[4] != 0xFB:
            return packet
        return packet[: 5 + byte] + bytes([packet[5 + byte] ^ mask]) + packet[6 + byte :]

    return damage


@pytest.mark.parametrize(("byte", "mask"), [(3, 0x80), (2, 0x10), (1, 0x80)])
def test_reports_with_a_bit_error_in_the_time_base_are_dropped(bench, byte, mask):
    bench.run(0.1)
    bench.hub.damage = flip_in_time_base(byte, mask)
    assert bench.run(0.1) == []
    assert bench.bno.counters.bad_times >= 27  # three reports each
    bench.hub.damage = lambda packet: packet
    assert all(abs(s.time_s - bench.now) < 0.2 for s in bench.run(0.1))


@pytest.mark.parametrize("lead_s", [-0.9, 0.04])
def test_reports_a_little_early_or_late_are_kept(bench, lead_s):
    bench.run(0.5)
    payload = struct.pack("<Bi", 0xFB, round(-lead_s / 1e-4)) + bytes.fromhex(
        "02 09 03 00 00 01 80 ff 00 03"
    )
    bench.bno._newest.clear()
    bench.bno._take_reports(payload, bench.now)
    assert bench.bno._newest[sh2.GYROSCOPE].time_s == pytest.approx(bench.now + lead_s)


def test_reports_that_nobody_asked_for_change_nothing(bench):
    bench.run(0.1)
    bench.hub.push(sh2.REPORTS, b"\xfb\0\0\0\0" + bytes.fromhex("04 09 02 00 40 00 c0 ff 20 00"))
    assert len(bench.run(0.5)) >= 45


def test_a_sample_is_as_accurate_as_its_worst_report(bench):
    bench.run(0.5)
    bench.bno._newest.clear()
    gyro, acceleration = "02 09 03 00 00 01 80 ff 00 03", "01 09 01 00 00 00 80 ff d0 09"
    rotation = "08 08 02 00 00 00 00 00 7e 18 21 3b"
    payload = b"\xfb\0\0\0\0" + bytes.fromhex(gyro + acceleration + rotation)
    [sample] = bench.bno._take_reports(payload, bench.now)
    assert sample.accuracy == 1
    assert sample.angular_velocity == (0.5, -0.25, 1.5)
    assert sample.acceleration == (0.0, -0.5, 9.8125)


def test_a_hub_that_continues_without_end_is_left(bench):
    bench.run(0.1)
    reads = []
    bench.bus.read = lambda _, count: (
        reads.append(count) or bytes([0x14, 0x80, 3, 0]).ljust(count, b"\0")
    )
    bad = bench.bno.counters.bad_packets
    assert bench.bno.poll() == []
    assert len(reads) <= 2 * bno085.MAX_PIECES
    assert bench.bno.counters.bad_packets == bad + 1


def test_reset_of_the_hub_switches_the_reports_on_again(bench):
    bench.run(0.1)
    said = len(bench.hub.written)
    bench.hub.reset()
    assert bench.hub.intervals_us == {}
    assert len(bench.run(0.5)) >= 40
    assert bench.bno.counters.resets == 2  # the first was ours
    assert len(bench.hub.written) == said + 3  # asked once for each report


def test_other_words_on_the_resets_channel_and_its_word_on_others_are_no_reset(bench):
    bench.run(0.1)
    bench.hub.push(sh2.EXECUTABLE, b"\x02")
    bench.hub.push(sh2.COMMAND, sh2.RESET_COMPLETE)
    bench.run(0.2)
    assert bench.bno.counters.resets == 1


def test_sequence_gaps_are_counted(bench):
    bench.run(0.1)
    bench.hub._sequence[sh2.REPORTS] += 3
    bench.run(0.1)
    assert bench.bno.reassembler.sequence_gaps == 1


def test_nobody_answers():
    bench = Bench()
    bench.bno = Bno085(bench.bus, 0x4B, 10000, clock=bench.clock, sleep=bench.sleep)
    with pytest.raises(DeviceError, match=r"no BNO085 at 0x4b.*check power, wiring"):
        bench.bno.start()


def test_something_else_answers():
    bench = Bench()
    bench.hub.damage = lambda packet: b"\x12" * len(packet)
    with pytest.raises(DeviceError, match="no BNO085 answers at 0x4a"):
        bench.bno.start()


class DriverBench(Bench):
    """The whole driver on the emulated hub."""

    def __init__(
        self, settings: ImuSettings | None = None, stream: RecordedStream | None = None
    ) -> None:
        super().__init__()
        settings = settings or ImuSettings()
        self.driver = ImuDriver(
            settings, lambda: self.bus, lambda: None, lambda: stream, self.clock, self.sleep
        )
        self.events = []

    def run(self, duration_s: float) -> list:
        samples = []
        end = self.now + duration_s
        while self.now < end:
            self.sleep(INTERVAL_S)
            cycle = self.driver.step(0.0)
            samples += cycle.samples
            self.events += cycle.events
        return samples


def test_driver_reports_its_rate():
    bench = DriverBench()
    bench.driver.connect()
    bench.run(2.0)
    status = bench.driver.status()
    assert status.level == OK
    assert status.values["rate [Hz]"] == pytest.approx(100.0, rel=0.2)


def test_driver_turns_to_base_axes():
    bench = DriverBench(ImuSettings(mount_roll=math.pi))  # upside down
    bench.driver.connect()
    samples = bench.run(0.5)
    assert samples[0].acceleration[2] == pytest.approx(-9.8, abs=0.3)
    assert samples[0].angular_velocity[2] == pytest.approx(-YAW_RATE, abs=0.05)


def test_frozen_values_start_the_sensor_again():
    bench = DriverBench()
    bench.driver.connect()
    bench.run(0.5)
    bench.hub.frozen = True
    bench.run(1.2)
    assert bench.events == ["IMU: values stand still for 1.0 s"]
    assert bench.driver.status().level == ERROR
    bench.run(10.0)  # the sensor answers each time it is started, and stays frozen
    assert len(bench.events) == 1
    assert isinstance(bench.events[0], Loss)
    bench.hub.frozen = False
    assert bench.run(6.0)
    assert bench.events[1:] == ["IMU connected again"]
    bench.hub.frozen = True
    bench.run(1.2)
    assert bench.events[2:] == ["IMU: values stand still for 1.0 s"]  # said again after it worked


def test_stamps_are_those_of_the_sensor_and_never_go_back():
    """One read is delayed, and the next one brings two frames."""
    first, second, *both = rvc_frames(range(4), 1.0)
    bench = DriverBench(
        ImuSettings(interface="rvc"), RecordedStream([first, second, b"".join(both)])
    )
    bench.driver.connect()
    times = []
    for now in (1000.0, 1000.018, 1000.020):
        bench.now = now
        times += [s.time_s for s in bench.driver.step(0.0).samples]
    late_s = 19 * 10 / 115200 + 0.005  # time on the wire, half of the time between two attitudes
    assert times == pytest.approx(
        [1000.018 - late_s, 1000.018 - late_s, 1000.020 - late_s], abs=2e-4
    )
    assert all(b - a > 0.9e-4 for a, b in itertools.pairwise(times))


def test_stamps_do_not_stay_ahead_after_the_sensor_was_started_again():
    bench = DriverBench()
    bench.driver.connect()
    bench.run(0.5)
    bench.driver._newest_s += 100.0  # however that came
    bench.bus.fault = lambda: errno.EREMOTEIO
    bench.run(1.2)
    bench.bus.fault = lambda: None
    samples = bench.run(8.0)
    assert samples
    assert all(s.time_s <= bench.now for s in samples)


def test_silence_then_return():
    bench = DriverBench()
    bench.driver.connect()
    bench.run(0.5)
    bench.bus.fault = lambda: errno.EREMOTEIO
    bench.run(10.0)
    assert "IMU: no samples for 1.0 s" in bench.events
    assert len(bench.events) == 2  # lost, and why it cannot come back; not once per attempt
    assert 4 <= bench.driver.status().values["reconnect attempts"] <= 7  # waits grow to 5 s
    before = bench.now
    bench.driver.step(0.01)
    assert bench.now - before == pytest.approx(0.01)  # a step that waits for nothing must not spin
    bench.bus.fault = lambda: None
    assert bench.run(8.0)
    assert bench.driver.connected


def test_an_unreliable_sensor_is_said():
    bench = DriverBench()
    report = bench.hub._report
    bench.hub._report = lambda report_id: report(report_id)[:2] + b"\0" + report(report_id)[3:]
    bench.driver.connect()
    bench.run(1.0)
    status = bench.driver.status()
    assert (status.level, status.message) == (WARN, "the sensor calls its values unreliable")


def test_bus_and_line_are_given_back():
    bench = DriverBench()
    line = Line(bench, age_s=0.0)
    bench.driver = ImuDriver(
        ImuSettings(), lambda: bench.bus, lambda: line, RecordedStream, bench.clock, bench.sleep
    )
    bench.driver.connect()
    bench.run(0.1)
    bench.driver.close()
    assert bench.bus.closed
    assert line.closed
    assert not bench.driver.connected
    bench.bus.closed = line.closed = False
    bench.bus.fault = lambda: errno.EREMOTEIO
    with pytest.raises(DeviceError):
        bench.driver.connect()
    assert bench.bus.closed
    assert line.closed


def test_a_slow_sensor_is_said():
    bench = DriverBench(replace(ImuSettings(), rate_hz=200.0))
    bench.driver.connect()
    bench.run(1.0)
    bench.driver.status()
    bench.run(1.0)  # polled at 100 Hz only
    assert (bench.driver.status().level, bench.driver.status().level) == (WARN, ERROR)


def test_absent_bus_is_raised_at_start():
    def absent():
        raise PortUnavailable("cannot open I2C bus")

    driver = ImuDriver(ImuSettings(), absent, lambda: None, RecordedStream)
    with pytest.raises(PortUnavailable):
        driver.connect()


def rvc_frames(indices, rate: float) -> list[bytes]:
    return [
        rvc.encode(rvc.RvcMessage(i % 256, rate * 0.01 * i, 0.0, 0.0, (0.0, 0.0, 9.80665)))
        for i in indices
    ]


def test_rvc_rate_is_the_difference_of_attitudes():
    clock = iter(range(1000))
    stream = RecordedStream(rvc_frames(range(250, 290), rate=1.0))
    device = Bno085Rvc(stream, clock=lambda: 0.01 * next(clock))
    samples = [s for _ in range(40) for s in device.poll(0.0)]
    assert len(samples) == 39  # the first has nothing to differ from; the index wraps on the way
    for sample in samples:
        assert sample.angular_velocity == pytest.approx((0.0, 0.0, 1.0), abs=0.02)
    steps = [b.time_s - a.time_s for a, b in itertools.pairwise(samples)]
    assert steps == pytest.approx([0.01] * 38)


def test_rvc_samples_of_one_read_are_stamped_when_each_was_measured():
    stream = RecordedStream([b"".join(rvc_frames([0, 1, 2, 4], rate=1.0))])
    times = [s.time_s for s in Bno085Rvc(stream, clock=lambda: 50.0).poll(0.0)]
    began = 50.0 - 19 * 10 / 115200  # 19 bytes of 10 bits were on the wire
    # half-way between two attitudes; the lost one between the last two took its 10 ms
    assert times == pytest.approx([began - 0.035, began - 0.025, began - 0.01])


def test_rvc_gaps():
    frames = rvc_frames([0, 1, 1, 3, 4, 7, 11, 40, 41], rate=0.5)
    device = Bno085Rvc(RecordedStream(frames), clock=lambda: 0.0)
    samples = [s for _ in frames for s in device.poll(0.0)]
    # none of the first, of a repeated one, and across more than 30 ms
    assert [round(s.angular_velocity[2], 1) for s in samples] == [0.5] * 5
    assert device.lost_frames == 1 + 2 + 3 + 28


@pytest.mark.parametrize("asked_hz", [10.0, 100.0, 200.0])
def test_rvc_has_its_own_rate_whatever_is_asked(asked_hz):
    stream = RecordedStream(rvc_frames(range(300), 1.0))
    bench = DriverBench(ImuSettings(interface="rvc", rate_hz=asked_hz), stream)
    bench.driver.connect()
    bench.run(2.0)
    assert bench.driver.status().level == OK


def tilted_frames(
    indices, pitch: float = 0.0, roll: float = 0.0, milli_g=(0, 0, 1000)
) -> list[bytes]:
    a = tuple(rvc.STANDARD_GRAVITY * value / 1000 for value in milli_g)
    return [rvc.encode(rvc.RvcMessage(i % 256, 1e-3 * i, pitch, roll, a)) for i in indices]


def up_in_sensor_axes(sample) -> tuple[float, float, float]:
    return rotate(conjugate(sample.orientation), (0.0, 0.0, 1.0))


def test_rvc_attitude_and_acceleration_agree_in_the_datasheets_frame():
    """pitch -1.10 deg, roll 20.85 deg, acceleration -371, -20, 977 mg."""
    body = bytes.fromhex("01 00 92 FF 25 08 8D FE EC FF D1 03 00 00 00")
    frames = [
        b"\xaa\xaa" + bytes([i]) + body + bytes([(i + sum(body)) & 0xFF]) for i in (0xDE, 0xDF)
    ]
    [sample] = Bno085Rvc(RecordedStream([b"".join(frames)]), clock=lambda: 0.0).poll(0.0)
    length = math.hypot(*sample.acceleration)
    cosine = sum(
        u * a / length for u, a in zip(up_in_sensor_axes(sample), sample.acceleration, strict=True)
    )
    assert math.degrees(math.acos(cosine)) < 0.1


def test_rvc_turns_are_applied_as_yaw_then_pitch_about_x_then_roll_about_y():
    generator = random.Random(4)
    for _ in range(20):
        yaw, pitch, roll = (
            generator.uniform(-3, 3),
            generator.uniform(-1.5, 1.5),
            generator.uniform(-3, 3),
        )
        cy, sy, cp, sp, cr, sr = (
            f(angle) for angle in (yaw, pitch, roll) for f in (math.cos, math.sin)
        )
        z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
        y = np.array([[cr, 0, sr], [0, 1, 0], [-sr, 0, cr]])
        q = attitude(rvc.RvcMessage(0, yaw, pitch, roll, (0.0, 0.0, 0.0)))
        for axis in np.eye(3):
            assert rotate(q, tuple(axis)) == pytest.approx(z @ x @ y @ axis)


def rvc_bench(frames: list[bytes], **settings) -> DriverBench:
    bench = DriverBench(ImuSettings(interface="rvc", **settings), RecordedStream(frames))
    bench.driver.connect()
    return bench


def test_attitude_that_disagrees_with_the_acceleration_is_said_once():
    upright, turned = (
        tilted_frames(range(300)),
        tilted_frames(range(300, 900), roll=math.radians(25.0)),
    )
    bench = rvc_bench([*upright, *turned, *tilted_frames(range(900, 1300))], mount_roll=0.4)
    bench.run(2.9)
    assert bench.events == []
    assert bench.driver.status().level == OK
    bench.run(6.0)  # two whole windows, and the one in which it began
    [event] = bench.events
    assert isinstance(event, Doubt)
    assert event.startswith("IMU: attitude and acceleration disagree by")
    status = bench.driver.status()
    said = "attitude and acceleration disagree by 25 deg on where up is: roll and pitch are wrong"
    assert (status.level, status.message) == (WARN, said)
    bench.run(4.0)  # held level again
    assert bench.driver.status().level == OK
    assert len(bench.events) == 1


@pytest.mark.parametrize(
    "frames",
    [
        tilted_frames(
            range(500), roll=math.radians(20.85), pitch=math.radians(-1.1), milli_g=(-371, -20, 977)
        ),
        tilted_frames(range(500), roll=math.radians(9.0)),
        tilted_frames(range(500), roll=math.radians(25.0), milli_g=(0, 0, 1060)),  # not at rest
        [
            frame
            for i in range(500)
            for frame in tilted_frames([i], milli_g=((-1) ** i * 310, 0, 1000))
        ],  # sways
    ],
    ids=["the datasheet's frame", "9 deg", "1.06 g", "swaying by 17 deg"],
)
def test_attitude_that_agrees_or_cannot_be_judged_is_not_doubted(frames):
    bench = rvc_bench(frames)
    bench.run(4.9)
    assert bench.events == []
    assert bench.driver.status().level == OK


def test_a_disagreement_is_not_said_again_after_the_sensor_was_lost():
    turned = tilted_frames(range(300), roll=math.radians(25.0))
    bench = rvc_bench([*turned, TransportError("unplugged"), *turned])
    bench.run(2.9)
    assert bench.driver.status().level == WARN
    bench.run(4.0)
    assert [event for event in bench.events if isinstance(event, Doubt)] == bench.events[:1]


def still_frames(indices) -> list[bytes]:
    return [rvc.encode(rvc.RvcMessage(i % 256, 0.3, 0.0, 0.0, (0.0, 0.0, 9.8))) for i in indices]


def test_rvc_frozen_values_are_told_from_silence_though_a_poll_may_bring_half_a_frame():
    halves = [half for frame in still_frames(range(250)) for half in (frame[:10], frame[10:])]
    for offset in (0, 1):  # which half the watchdog meets
        bench = rvc_bench(halves[offset:])
        bench.run(1.5)
        assert bench.events == ["IMU: values stand still for 1.0 s"]


def test_rvc_silence_after_two_equal_samples_is_no_samples():
    bench = rvc_bench([*rvc_frames(range(5), 1.0), *still_frames(range(5, 10))])
    bench.run(1.5)
    assert bench.events == ["IMU: no samples for 1.0 s"]


def test_rvc_port_lost_and_silent():
    stream = RecordedStream([*rvc_frames(range(5), 1.0), TransportError("unplugged")])
    bench = DriverBench(ImuSettings(interface="rvc"), stream)
    bench.driver.connect()
    assert len(bench.run(0.1)) == 4
    assert bench.events == ["unplugged"]
    assert stream.closed
    bench.run(2.0)  # opened again, but silent
    assert "IMU: no samples for 1.0 s" in bench.events
