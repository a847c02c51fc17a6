# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The Vertiq device code on recorded bytes and on the emulated module behind a real port."""

import math
import struct

import pytest
from fakes import RecordedStream, wait_until

from fish_hw.devices.reconnect import DeviceError
from fish_hw.devices.vertiq import RotorTelemetry, Vertiq
from fish_hw.protocol import iquart
from fish_hw.protocol.iquart import REPLY, SET, Message, encode
from fish_hw.transport.serial_port import SerialPort

VELOCITY_REPLY = bytes.fromhex("55 06 32 0d 03 00 00 18 41 35 fa")  # 9.5 rad/s, vendor's library
ANGLE_REPLY = encode(Message(50, 12, REPLY, 0, struct.pack("<f", 1.25)))
PATIENT_S = 0.2  # a loaded machine may keep the emulator waiting


class SteppedClock:
    """Every look costs 1 ms, so that waiting loops end without waiting."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 0.001
        return self.now


def recorded(*chunks: bytes, **kwargs) -> tuple[Vertiq, RecordedStream]:
    stream = RecordedStream(chunks)
    return Vertiq(stream, clock=SteppedClock(), **kwargs), stream


@pytest.fixture
def module(vertiq_emulator):
    port = SerialPort(vertiq_emulator.port, 115200)
    yield Vertiq(port, reply_timeout_s=PATIENT_S), vertiq_emulator
    port.close()


def test_drive_sends_command_and_questions_and_reads_both():
    vertiq, stream = recorded(b"", VELOCITY_REPLY[:4], VELOCITY_REPLY[4:] + ANGLE_REPLY)
    sample = vertiq.drive(10.0)
    assert stream.written == [
        bytes.fromhex(
            "55 06 34 05 01 00 00 20 41 ed 9e  55 02 32 0d 00 31 b4  55 02 32 0c 00 00 87"
        )
    ]
    assert (sample.velocity, sample.angle) == (9.5, 1.25)


def test_sign_mirrors_command_and_measurement():
    vertiq, stream = recorded(b"", VELOCITY_REPLY + ANGLE_REPLY, sign=-1)
    sample = vertiq.drive(-10.0)
    assert stream.written[0].startswith(bytes.fromhex("55 06 34 05 01 00 00 20 41 ed 9e"))
    assert (sample.velocity, sample.angle) == (-9.5, -1.25)
    vertiq.command(-10.0)  # the way down to a stop: the other sign would reverse the rotor
    assert stream.written[1] == bytes.fromhex("55 06 34 05 01 00 00 20 41 ed 9e")


def test_coast_is_said_three_times():
    vertiq, stream = recorded()
    vertiq.coast()
    assert stream.written == [bytes.fromhex("55 02 34 02 01 8e 06") * 3]


@pytest.mark.parametrize(
    "reply", [b"", VELOCITY_REPLY, ANGLE_REPLY], ids=["nothing", "no angle", "no speed"]
)
def test_silence_is_no_sample(reply):
    vertiq, _ = recorded(b"", reply)
    assert vertiq.measure() is None
    assert vertiq.counters.timeouts == 1


def test_a_sample_is_stamped_in_the_middle_of_its_exchange():
    vertiq, _ = recorded(b"", b"", b"", b"", VELOCITY_REPLY + ANGLE_REPLY)
    vertiq._clock.now = before = 50.0
    sample = vertiq.measure()
    assert vertiq._clock.now - before > 0.0055
    assert sample.time_s == pytest.approx((before + vertiq._clock.now) / 2, abs=0.001)


class TimedStream(RecordedStream):
    """Reads that find nothing take their whole time; every write is dated."""

    def __init__(self, clock: SteppedClock) -> None:
        super().__init__()
        self.clock, self.sent = clock, []

    def write(self, data: bytes) -> None:
        self.sent.append(self.clock.now)
        super().write(data)

    def read(self, timeout_s: float) -> bytes:
        got = super().read(timeout_s)
        self.clock.now += 0.002 if got else timeout_s
        return got


@pytest.mark.parametrize(
    "ask", [lambda v: v.drive(10.0), lambda v: v.measure()], ids=["drive", "measure"]
)
def test_a_sample_behind_an_unanswered_question_is_stamped_between_its_own_question_and_answer(ask):
    clock = SteppedClock()
    stream = TimedStream(clock)
    vertiq = Vertiq(stream, clock=clock)
    assert vertiq.read(iquart.DERATE) == [None]  # older firmware has no such register
    stream.chunks.extend([b"", b"", VELOCITY_REPLY + ANGLE_REPLY])
    sample = ask(vertiq)
    assert sample.time_s == pytest.approx((stream.sent[-1] + clock.now) / 2, abs=0.0005)


def test_an_exchange_ends_with_its_last_answer():
    vertiq, _ = recorded(b"", VELOCITY_REPLY + ANGLE_REPLY)
    vertiq.measure()
    assert vertiq._clock.now < 0.0055  # and does not wait out its 8 ms


def test_late_reply_is_not_the_next_answer():
    late = encode(Message(50, 13, REPLY, 0, struct.pack("<f", 77.0)))
    vertiq, _ = recorded()
    assert vertiq.measure() is None
    vertiq._stream.chunks.extend([b"", late, b"", VELOCITY_REPLY + ANGLE_REPLY])
    assert vertiq.measure().velocity == 9.5
    assert vertiq.counters.unexpected == 1


def test_command_goes_out_before_the_wait_for_late_replies():
    vertiq, stream = recorded()
    vertiq.measure()
    vertiq.drive(10.0)
    assert stream.written[1] == bytes.fromhex("55 06 34 05 01 00 00 20 41 ed 9e")
    assert stream.written[2] == bytes.fromhex("55 02 32 0d 00 31 b4  55 02 32 0c 00 00 87")


def test_answers_behind_a_false_start_are_found_when_the_line_falls_silent():
    vertiq, _ = recorded(b"", b"\x55\x3b" + VELOCITY_REPLY + ANGLE_REPLY)
    assert vertiq.measure().velocity == 9.5


def test_a_command_waits_for_nothing():
    vertiq, stream = recorded()
    read, waits = stream.read, []
    stream.read = lambda timeout_s: (
        waits.append((len(stream.written), timeout_s)) or read(timeout_s)
    )
    for written in (0, 1):  # at first, and after a question without an answer
        vertiq.drive(10.0)
        assert next(t for n, t in waits if n == written) == 0.0
        assert stream.written[written].startswith(bytes.fromhex("55 06 34 05 01"))
        waits.clear()


@pytest.mark.parametrize(
    "wrong",
    [
        encode(Message(50, 13, REPLY, 5, struct.pack("<f", 1.0))),  # another module
        encode(Message(69, 0, REPLY, 0, struct.pack("<f", 1.0))),  # another register
        encode(Message(50, 13, REPLY, 0, b"\0\0")),  # wrong size
        bytes.fromhex("55 02 32 0d 00 31 b4"),  # our own question, echoed by half-duplex wiring
        encode(Message(50, 13, SET, 0, struct.pack("<f", 1.0))),  # our own order, echoed
    ],
)
def test_messages_that_are_no_answer_are_counted(wrong):
    vertiq, _ = recorded(b"", wrong + VELOCITY_REPLY + ANGLE_REPLY)
    assert vertiq.measure().velocity == 9.5
    assert vertiq.counters.unexpected == 1


@pytest.mark.parametrize(
    "register", [iquart.OBS_VELOCITY, iquart.OBS_ANGLE], ids=["speed", "angle"]
)
def test_value_that_is_no_number_is_no_sample(register):
    nan = encode(Message(register.type, register.param, REPLY, 0, struct.pack("<f", math.nan)))
    vertiq, _ = recorded(
        b"", nan + (ANGLE_REPLY if register is iquart.OBS_VELOCITY else VELOCITY_REPLY)
    )
    assert vertiq.measure() is None
    assert vertiq.counters.unexpected == 1


@pytest.mark.parametrize(
    "register", [iquart.OBS_VELOCITY, iquart.OBS_ANGLE], ids=["speed", "angle"]
)
@pytest.mark.parametrize("absurd", [1e30, -1e5])
def test_an_absurd_value_is_no_sample_and_spoils_no_later_angle(register, absurd):
    wrong = encode(Message(register.type, register.param, REPLY, 0, struct.pack("<f", absurd)))
    good = VELOCITY_REPLY + ANGLE_REPLY
    other = ANGLE_REPLY if register is iquart.OBS_VELOCITY else VELOCITY_REPLY
    vertiq, _ = recorded(b"", good, b"", wrong + other, b"", good)
    before = vertiq.measure()
    assert vertiq.measure() is None
    assert vertiq.counters.unexpected == 1
    vertiq._clock.now += 0.01
    assert vertiq.measure().angle == pytest.approx(before.angle, abs=2 * math.tau)


def test_angle_is_continuous_through_many_turns():
    vertiq, stream = recorded()
    period, speed = 0.02, 120.0  # 2.4 rad per sample: more than a third of a turn
    for i in range(100):
        vertiq._clock.now = i * period
        angle = speed * i * period
        wrapped = math.remainder(angle, math.tau)
        velocity = encode(Message(50, 13, REPLY, 0, struct.pack("<f", speed)))
        stream.chunks.extend(
            [b"", velocity + encode(Message(50, 12, REPLY, 0, struct.pack("<f", wrapped)))]
        )
        assert vertiq.measure().angle == pytest.approx(angle, abs=1e-4)


def test_configure_writes_and_reads_back(module):
    vertiq, emulator = module
    coast_quietly = [
        (r.type, r.param)
        for r in (iquart.TIMEOUT_BEHAVIOR, iquart.TIMEOUT_MEANING, iquart.TIMEOUT_SONG)
    ]
    emulator.written |= dict.fromkeys(coast_quietly, b"\1")
    assert vertiq.configure(0.25) == []
    assert emulator.timeout_s == 0.25
    assert [emulator.written[address] for address in coast_quietly] == [b"\0"] * 3


def test_a_module_that_refuses_its_watchdog_is_not_used(module):
    vertiq, emulator = module
    kept = encode(
        Message(iquart.TIMEOUT.type, iquart.TIMEOUT.param, REPLY, 0, struct.pack("<f", 1.0))
    )
    emulator.mangle = lambda reply: kept if reply[2:4] == kept[2:4] else reply
    with pytest.raises(DeviceError, match=r"refuses a timeout of 0.25 s"):
        vertiq.configure(0.25)


def test_tuning_is_what_the_module_has_and_what_it_lacks_is_left_out(module):
    vertiq, emulator = module
    vertiq._reply_timeout_s = 0.05
    del emulator.written[iquart.FIRMWARE.type, iquart.FIRMWARE.param]
    emulator.written[iquart.INPUT_FILTER.type, iquart.INPUT_FILTER.param] = struct.pack("<I", 500)
    tuning = vertiq.tuning()
    assert tuning["command filter [Hz]"] == 500
    assert tuning["velocity feed-forward [V s/rad]"] == pytest.approx(0.0258)
    assert "firmware version" not in tuning


def test_configure_names_settings_that_the_firmware_lacks(module):
    vertiq, emulator = module
    vertiq._reply_timeout_s = 0.02
    del emulator.written[iquart.TIMEOUT_SONG.type, iquart.TIMEOUT_SONG.param]
    assert vertiq.configure(0.25) == ["module does not take timeout song = 0"]


def test_configure_without_module_says_what_came():
    vertiq, _ = recorded(b"", b"noise")
    with pytest.raises(DeviceError, match=r"no Vertiq module 0 answers \(5 bytes of noise"):
        vertiq.configure(0.25)


def test_telemetry(module):
    vertiq, emulator = module
    emulator.volts, emulator.amps, emulator.faults = 14.2, 3.5, 0b100100
    emulator.controller_c, emulator.coil_c = 36.5, 51.5
    emulator._booted -= 3600.0
    telemetry = telemetry_of(vertiq)
    assert (telemetry.volts, telemetry.amps) == pytest.approx((14.2, 3.5))
    assert (telemetry.controller_c, telemetry.coil_c) == pytest.approx((36.5, 51.5))
    assert telemetry.uptime_s == pytest.approx(3600.0, abs=5.0)
    assert iquart.fault_names(telemetry.faults) == ["reference voltage", "controller temperature"]
    assert (telemetry.derate, telemetry.mode) == (1.0, iquart.COAST)


def telemetry_of(vertiq: Vertiq) -> RotorTelemetry:
    """Answers to both questions."""
    return vertiq.power().completed(vertiq.state())


def dropping(*registers: iquart.Register):
    """Damage: no answers of these registers."""
    silent = [(register.type, register.param) for register in registers]
    return lambda reply: b"" if (reply[2], reply[3]) in silent else reply


def test_telemetry_keeps_the_answers_that_came(module):
    vertiq, emulator = module
    emulator.faults = 0b10
    emulator.mangle = dropping(iquart.DERATE)
    telemetry = telemetry_of(vertiq)
    assert (telemetry.volts, telemetry.faults, telemetry.derate) == (
        pytest.approx(14.8),
        0b10,
        None,
    )
    emulator.mangle = dropping(iquart.TELEMETRY)
    telemetry = telemetry_of(vertiq)
    assert (telemetry.volts, telemetry.faults, telemetry.derate) == (None, 0b10, 1.0)
    emulator.mangle = dropping(iquart.FAULT_NOW, iquart.CTRL_MODE)
    telemetry = telemetry_of(vertiq)
    assert (telemetry.volts, telemetry.faults, telemetry.mode) == (pytest.approx(14.8), None, None)


def test_a_register_that_is_never_answered_is_not_asked_for_ever(module):
    vertiq, emulator = module
    emulator.mangle = dropping(iquart.DERATE)
    for _ in range(5):
        assert vertiq.state().faults == 0
    asked = sum(
        (m.type, m.param) == (iquart.DERATE.type, iquart.DERATE.param) for m in emulator.log
    )
    assert asked == 3


def test_fault_memory_that_could_not_be_read_is_not_erased(module):
    vertiq, emulator = module
    emulator.faults_ever = 0b10
    emulator.mangle = dropping(iquart.FAULT_EVER)
    assert vertiq.clear_faults() is None
    emulator.mangle = lambda reply: reply
    assert vertiq.read(iquart.FAULT_EVER) == [
        (0b10,)
    ]  # by now the module would have taken an order to erase


def test_fault_memory_is_told_before_it_is_cleared(module):
    vertiq, emulator = module
    emulator.faults_ever = 0b10
    assert vertiq.clear_faults() == 0b10
    assert wait_until(lambda: emulator.faults_ever == 0)


@pytest.mark.parametrize(
    "mangle",
    [
        lambda reply: reply[:-1] + bytes([reply[-1] ^ 1]),
        lambda reply: reply[:5],
        lambda _: b"",
        lambda _: b"\x55\x20" * 3,
    ],
    ids=["crc", "truncated", "dropped", "garbage"],
)
def test_broken_replies_then_recovery(module, mangle):
    vertiq, emulator = module
    vertiq._reply_timeout_s = 0.02
    emulator.mangle = mangle
    assert vertiq.measure() is None
    emulator.mangle = lambda reply: b"\x55\x07" + reply  # garbage before the frame is no obstacle
    vertiq._reply_timeout_s = PATIENT_S
    assert vertiq.measure() is not None
