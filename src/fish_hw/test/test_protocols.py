# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bytes to messages and back: IQUART, SHTP and SH-2, UART-RVC.

Each against recorded bytes, messages of the vendors' libraries, and damage.
"""

import math
import random
import struct

import pytest

from fish_hw.protocol import sh2
from fish_hw.protocol.iquart import GET, REPLY, SAVE, SET, Message, Parser, encode
from fish_hw.protocol.rvc import RvcMessage, RvcParser
from fish_hw.protocol.rvc import encode as encode_rvc
from fish_hw.protocol.sh2 import Drops, parse_reports

T = 100.0  # s, when the packets below were read
REQUESTS = [
    (0x08, 20000, "15 00 02 00 fd 08 00 00 00 20 4e 00 00 00 00 00 00 00 00 00 00"),
    (0x05, 10000, "15 00 02 01 fd 05 00 00 00 10 27 00 00 00 00 00 00 00 00 00 00"),
    (0x02, 10000, "15 00 02 02 fd 02 00 00 00 10 27 00 00 00 00 00 00 00 00 00 00"),
    (0x04, 10000, "15 00 02 03 fd 04 00 00 00 10 27 00 00 00 00 00 00 00 00 00 00"),
]
YAW45 = (0.0, 0.0, 0.38269, 0.92389)
REPORTS = [
    ("17 00 03 01 fb 11 00 00 00 05 07 03 00 00 00 00 00 7e 18 21 3b cd 00", 0x05, YAW45, 3),
    ("15 00 03 02 fb 11 00 00 00 08 08 03 00 00 00 00 00 7e 18 21 3b", 0x08, YAW45, 3),
    ("13 00 03 03 fb 11 00 00 00 02 09 03 00 00 01 80 ff 00 03", 0x02, (0.5, -0.25, 1.5), 3),
    ("13 00 03 04 fb 11 00 00 00 01 09 03 00 00 00 80 ff d0 09", 0x01, (0.0, -0.5, 9.8125), 3),
    ("13 00 03 05 fb 11 00 00 00 04 09 02 00 40 00 c0 ff 20 00", 0x04, (0.25, -0.25, 0.125), 2),
]
GYRO_PACKET = bytes.fromhex(REPORTS[2][0])

G = 9.80665
DATASHEET = bytes.fromhex("AA AA DE 01 00 92 FF 25 08 8D FE EC FF D1 03 00 00 00 E7")
FRAMES = [
    (DATASHEET, 222, (0.01, -1.10, 20.85), (-3.638, -0.196, 9.581)),
    (
        bytes.fromhex("aa aa 00 94 11 18 fc fa 00 00 00 00 00 e8 03 00 00 00 9e"),
        0,
        (45.0, -10.0, 2.5),
        (0.0, 0.0, G),
    ),
    (
        bytes.fromhex("aa aa ff b1 b9 27 23 4f 46 18 fc f4 01 06 ff 00 00 00 56"),
        255,
        (-179.99, 89.99, 179.99),
        (-9.807, 4.903, -2.452),
    ),
]
TEXT = b"%Hillcrest Labs 10003608\r\n%SW Ver 3.2.7\r\n%(c) 2017 Hillcrest Laboratories\r\n"


def f32(value: float) -> bytes:
    return struct.pack("<f", value)


GOLDEN = [
    (Message(0x34, 0x05, SET, 0, f32(10.0)), "55 06 34 05 01 00 00 20 41 ed 9e"),
    (Message(0x34, 0x05, SET, 0, f32(-10.0)), "55 06 34 05 01 00 00 20 c1 65 0f"),
    (Message(0x34, 0x05, SET, 0, f32(113.0973)), "55 06 34 05 01 d1 31 e2 42 9a f2"),
    (Message(0x34, 0x05, SET, 0, f32(0.0)), "55 06 34 05 01 00 00 00 00 ee c0"),
    (Message(0x34, 0x05, SET, 5, f32(10.0)), "55 06 34 05 15 00 00 20 41 b1 13"),
    (Message(0x34, 0x04, SET, 0, f32(1.5)), "55 06 34 04 01 00 00 c0 3f a6 54"),
    (Message(0x34, 0x02, SET), "55 02 34 02 01 8e 06"),
    (Message(0x34, 0x01, SET), "55 02 34 01 01 dd 53"),
    (Message(0x34, 0x0F, SET, 0, f32(0.25)), "55 06 34 0f 01 00 00 80 3e e9 8a"),
    (Message(0x34, 0x11, SET, 0, b"\0"), "55 03 34 11 01 00 a4 5e"),
    (Message(0x34, 0x12, SET, 0, b"\0"), "55 03 34 12 01 00 f4 07"),
    (Message(0x34, 0x12, SET, 0, b"\1"), "55 03 34 12 01 01 d5 17"),
    (Message(0x34, 0x13, SET, 0, b"\0"), "55 03 34 13 01 00 c4 30"),
    (Message(0x34, 0x07, SET, 0, f32(0.02)), "55 06 34 07 01 0a d7 a3 3c f3 7c"),
    (Message(0x34, 0x07, SAVE), "55 02 34 07 02 18 c9"),
    (Message(0x34, 0x0B, SET, 0, f32(0.0258)), "55 06 34 0b 01 86 5a d3 3c 48 94"),
    (Message(0x54, 0x01, SET, 0, b"\0"), "55 03 54 01 01 00 15 44"),
    (Message(0x54, 0x02, SET, 0, b"\1"), "55 03 54 02 01 01 64 0d"),
    (Message(0x10, 0x00, SET, 0, struct.pack("<I", 921600)), "55 06 10 00 01 00 10 0e 00 b3 4c"),
    (Message(0x05, 0x00, SET), "55 02 05 00 01 79 92"),
    (Message(0x56, 0x0C, SET, 0, b"\0"), "55 03 56 0c 01 00 2c eb"),
    (Message(0x32, 0x0D, GET), "55 02 32 0d 00 31 b4"),
    (Message(0x32, 0x0D, GET, 5), "55 02 32 0d 14 84 e6"),
    (Message(0x32, 0x0C, GET), "55 02 32 0c 00 00 87"),
    (Message(0x45, 0x00, GET), "55 02 45 00 00 f5 9f"),
    (Message(0x49, 0x00, GET), "55 02 49 00 00 94 ea"),
    (Message(0x53, 0x00, GET), "55 02 53 00 00 36 6e"),
    (Message(0x54, 0x00, GET), "55 02 54 00 00 a6 eb"),
    (Message(0x54, 0x01, GET), "55 02 54 01 00 97 d8"),
    (Message(0x34, 0x00, GET), "55 02 34 00 00 cd 70"),
    (Message(0x34, 0x0F, GET), "55 02 34 0f 00 f3 60"),
    (Message(0x05, 0x10, GET), "55 02 05 10 00 2b 81"),
    (Message(0x05, 0x0F, GET), "55 02 05 0f 00 66 92"),
    (Message(0x58, 0x01, GET), "55 02 58 01 00 f6 ad"),
    (Message(0x3B, 0x04, SET, 0, f32(10.0)), "55 06 3b 04 01 00 00 20 41 a4 51"),
    (Message(0x32, 0x0D, REPLY, 0, f32(9.5)), "55 06 32 0d 03 00 00 18 41 35 fa"),
    (Message(0x32, 0x0D, REPLY, 0, f32(-113.25)), "55 06 32 0d 03 00 80 e2 c2 8e 9c"),
    (Message(0x45, 0x00, REPLY, 0, f32(14.8)), "55 06 45 00 03 cd cc 6c 41 7a 34"),
    (Message(0x49, 0x00, REPLY, 0, f32(41.5)), "55 06 49 00 03 00 00 26 42 c1 6d"),
    (Message(0x54, 0x00, REPLY, 0, b"\4"), "55 03 54 00 03 04 c3 55"),
    (
        Message(0x58, 0x01, REPLY, 0, struct.pack("<6hI", 3550, 4125, 1480, 52, 12, -113, 3600)),
        "55 12 58 01 03 de 0d 1d 10 c8 05 34 00 0c 00 8f ff 10 0e 00 00 73 30",
    ),
]
REPLIES = [Message(0x32, 0x0D, REPLY, 0, f32(0.5 * i - 60.0)) for i in range(200)]


@pytest.mark.parametrize(("message", "expected"), GOLDEN)
def test_golden_bytes_both_ways(message, expected):
    data = bytes.fromhex(expected)
    assert encode(message) == data
    parser = Parser()
    assert parser.feed(data) == [message]
    assert (parser.crc_errors, parser.skipped_bytes, parser.pending) == (0, 0, 0)


def test_every_split_position():
    data = encode(REPLIES[0]) + encode(REPLIES[1])
    for cut in range(len(data) + 1):
        parser = Parser()
        assert parser.feed(data[:cut]) + parser.feed(data[cut:]) == REPLIES[:2]


def test_byte_by_byte_behind_garbage():
    parser = Parser()
    data = b"\x00\xffhello" + encode(REPLIES[3])
    assert [m for b in data for m in parser.feed(bytes([b]))] == [REPLIES[3]]
    assert parser.skipped_bytes == 7


def test_stray_start_byte_costs_no_good_message():
    parser = Parser()
    got = parser.feed(b"\x55" + b"".join(encode(m) for m in REPLIES[:40]))
    assert got + parser.flush() == REPLIES[:40]


def test_start_byte_inside_data():
    message = Message(0x55, 0x55, REPLY, 0, b"\x55\x02\x55\x55")
    assert Parser().feed(encode(message) * 3) == [message] * 3


def test_crc_flip_is_counted_and_dropped():
    data = bytearray(encode(REPLIES[0]))
    data[-1] ^= 1
    parser = Parser()
    assert parser.feed(bytes(data) + encode(REPLIES[1])) + parser.flush() == [REPLIES[1]]
    assert parser.crc_errors == 1


@pytest.mark.parametrize("length", [0, 1, 60, 255])
def test_impossible_length_is_skipped(length):
    parser = Parser()
    assert parser.feed(bytes([0x55, length]) + encode(REPLIES[1])) + parser.flush() == [REPLIES[1]]


def test_false_start_that_promises_much_hides_nothing_after_flush():
    parser = Parser()
    assert parser.feed(b"\x55\x3b" + encode(REPLIES[1]) + encode(REPLIES[2])) == []
    assert parser.flush() == REPLIES[1:3]
    assert parser.pending == 0


def test_random_bit_flips_in_random_pieces():
    generator = random.Random(4)
    frames = [bytearray(encode(m)) for m in REPLIES]
    hit = set()
    for _ in range(80):
        frame, byte = generator.randrange(len(frames)), generator.randrange(11)
        frames[frame][byte] ^= 1 << generator.randrange(8)
        hit.add(frame)
    data, parser, got = b"".join(frames), Parser(), []
    while data:
        size = generator.randint(1, 8)
        got += parser.feed(data[:size])
        data = data[size:]
    got += parser.flush()
    damaged = {bytes(frames[i]) for i in hit}
    intact = [m for i, m in enumerate(REPLIES) if i not in hit or encode(m) in damaged]
    assert got == intact


def test_noise_alone_gives_nothing():
    parser = Parser()
    noise = random.Random(1).randbytes(20000)
    assert parser.feed(noise) + parser.flush() == []
    assert parser.skipped_bytes == 20000


def test_programmer_errors_raise():
    with pytest.raises(ValueError, match="module id is 64"):
        encode(Message(1, 1, GET, 64))
    with pytest.raises(ValueError, match="58 bytes of data, expected at most 57"):
        encode(Message(1, 1, SET, 0, bytes(58)))


def parse(packet: str | bytes, drops: Drops | None = None) -> list:
    data = packet if isinstance(packet, bytes) else bytes.fromhex(packet)
    return parse_reports(data[4:], T, drops if drops is not None else Drops())


def test_feature_requests_with_counted_sequence():
    writer = sh2.Writer()
    for report_id, interval_us, expected in REQUESTS:
        framed = writer.frame(sh2.CONTROL, sh2.set_feature(report_id, interval_us))
        assert framed == bytes.fromhex(expected)


def test_reset_and_product_id_request():
    assert sh2.Writer().frame(sh2.EXECUTABLE, sh2.RESET_COMMAND) == bytes.fromhex("05 00 01 00 01")
    assert sh2.Writer().frame(sh2.CONTROL, sh2.product_id_request()) == bytes.fromhex(
        "06 00 02 00 f9 00"
    )


def test_sequence_wraps_and_is_kept_per_channel():
    writer = sh2.Writer()
    numbers = [writer.frame(sh2.CONTROL, b"x")[3] for _ in range(257)]
    assert numbers[-2:] == [255, 0]
    assert writer.frame(sh2.EXECUTABLE, b"x")[3] == 0


def test_product_id():
    product = sh2.parse_product_id(
        bytes.fromhex("14 00 02 01 f8 01 03 02 98 a4 98 00 72 01 00 00 07 00 00 00")[4:]
    )
    assert str(product) == "part 10003608 version 3.2.7 build 370"
    assert sh2.parse_product_id(b"\xf8\x01") is None
    assert sh2.parse_product_id(b"\xfc" + bytes(16)) is None


def test_feature_response_tells_the_real_interval():
    payload = b"\xfc" + sh2.set_feature(0x08, 9000)[1:]
    assert sh2.parse_feature_response(payload) == (0x08, 9000)
    assert sh2.parse_feature_response(payload[:10]) is None


@pytest.mark.parametrize(("packet", "report_id", "values", "accuracy"), REPORTS)
def test_reports(packet, report_id, values, accuracy):
    (report,) = parse(packet)
    assert (report.id, report.accuracy) == (report_id, accuracy)
    assert report.values == pytest.approx(values, abs=1e-5)
    assert report.time_s == pytest.approx(T - 17 * 100e-6)


def test_batch_with_base_and_delay():
    packet = "21 00 03 06 fb 78 00 00 00 05 09 03 00 00 00 00 00 7e 18 21 3b cd 00 02 0a 03 19 00 01 80 ff 00 03"
    rotation, gyro = parse(packet)
    assert rotation.time_s == pytest.approx(T - 12.0e-3)
    assert gyro.time_s == pytest.approx(T - 12.0e-3 + 2.5e-3)


def test_delay_has_fourteen_bits():
    payload = bytearray(GYRO_PACKET)
    payload[4 + 5 + 2] = 0x03 | 0x04  # lowest of the six upper bits of the delay
    (report,) = parse(bytes(payload))
    assert report.accuracy == 3
    assert report.time_s == pytest.approx(T - 17e-4 + 256e-4)


def test_rebase_moves_the_base_forward():
    gyro = GYRO_PACKET[9:]
    payload = struct.pack("<Bi", 0xFB, 200) + gyro + struct.pack("<Bi", 0xFA, 50) + gyro
    first, second = parse_reports(payload, T, Drops())
    assert first.time_s == pytest.approx(T - 20e-3)
    assert second.time_s == pytest.approx(T - 15e-3)


def test_a_base_may_lie_after_the_read_or_be_too_long_ago_to_say():
    for ticks, lead_s in ((-30, 3e-3), (0x7FFFFFFF, 0.0)):
        [report] = parse_reports(struct.pack("<Bi", 0xFB, ticks) + GYRO_PACKET[9:], T, Drops())
        assert report.time_s == pytest.approx(T + lead_s)


def test_a_rebase_without_a_base_is_not_guessed():
    drops = Drops()
    assert parse_reports(struct.pack("<Bi", 0xFA, 50) + GYRO_PACKET[9:], T, drops) == []
    assert drops.unknown_reports == 1


def test_reports_without_numbers_are_stepped_over():
    stability, raw_gyro = b"\x13" + bytes(5), b"\x15" + bytes(15)
    payload = GYRO_PACKET[4:] + stability + raw_gyro + GYRO_PACKET[9:]
    assert [r.values for r in parse_reports(payload, T, Drops())] == [(0.5, -0.25, 1.5)] * 2


def test_lost_first_bit_as_seen_on_real_buses_is_dropped():
    drops = Drops()
    assert parse(GYRO_PACKET.replace(b"\xfb", b"\x7b"), drops) == []
    assert drops.unknown_reports == 1


def test_unknown_report_ends_the_cargo_but_keeps_what_came_before():
    drops = Drops()
    payload = GYRO_PACKET[4:] + b"\x77" + bytes(9) + GYRO_PACKET[9:]
    assert [r.id for r in parse_reports(payload, T, drops)] == [0x02]
    assert drops.unknown_reports == 1


def test_truncation_at_every_byte_never_raises_and_never_invents():
    payload = GYRO_PACKET[4:] * 2
    for size in range(len(payload)):
        drops = Drops()
        reports = parse_reports(payload[:size], T, drops)
        assert len(reports) == size // len(GYRO_PACKET[4:])
        assert drops.truncated_reports == (size not in (0, 5, 15, 20))  # ends of bases and reports
        assert all(r.values == (0.5, -0.25, 1.5) for r in reports)


def test_random_bytes_never_raise():
    import random

    generator = random.Random(2)
    for _ in range(2000):
        data = generator.randbytes(generator.randrange(4, 60))
        sh2.parse_header(data)
        for report in parse_reports(data, T, Drops()):
            assert all(math.isfinite(v) for v in report.values)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ("ff ff ff ff", "failed peripheral"),
        ("13 00 06 00", "channel 6"),
        ("03 00 03 00", "shorter than a header"),
        ("ff 7f 03 00", "longer than any cargo"),
    ],
)
def test_headers_that_no_hub_sends(data, reason):
    assert sh2.parse_header(bytes.fromhex(data)) is None, reason


def test_empty_and_continued_headers():
    assert sh2.parse_header(bytes(4)).empty
    header = sh2.parse_header(bytes.fromhex("13 80 03 07"))
    assert (header.length, header.channel, header.sequence, header.continuation) == (
        0x13,
        3,
        7,
        True,
    )
    assert not sh2.parse_header(bytes.fromhex("13 00 03 07")).continuation


@pytest.mark.parametrize(
    ("data", "length", "channel"), [("04 00 05 00", 4, 5), ("fe 7f 00 00", 32766, 0)]
)
def test_the_shortest_and_the_longest_cargo_and_the_last_channel_are_accepted(
    data, length, channel
):
    header = sh2.parse_header(bytes.fromhex(data))
    assert (header.length, header.channel) == (length, channel)


def test_fragments_are_joined():
    joined = sh2.Reassembler()
    first = sh2.Header(4 + 10, 0, 5, False)
    rest = sh2.Header(4 + 4, 0, 6, True)
    assert joined.feed(first, b"abcdef") is None
    assert joined.feed(rest, b"ghij").payload == b"abcdefghij"
    assert (joined.orphans, joined.sequence_gaps) == (0, 0)


def test_fragment_without_beginning_and_beginning_without_end():
    joined = sh2.Reassembler()
    assert joined.feed(sh2.Header(8, 0, 1, True), b"ghij") is None
    assert joined.feed(sh2.Header(14, 0, 2, False), b"abc") is None
    assert joined.feed(sh2.Header(6, 0, 3, False), b"xy").payload == b"xy"
    assert joined.orphans == 2


def test_after_a_reset_nothing_is_missed():
    joined = sh2.Reassembler()
    joined.feed(sh2.Header(14, 3, 7, False), b"abc")
    joined.reset()
    assert joined.feed(sh2.Header(6, 3, 0, False), b"xy").payload == b"xy"
    assert (joined.orphans, joined.sequence_gaps) == (0, 0)


def test_sequence_gap_is_counted_per_channel():
    joined = sh2.Reassembler()
    for channel, sequence in ((3, 254), (3, 255), (3, 0), (2, 9), (3, 1), (3, 4)):
        joined.feed(sh2.Header(5, channel, sequence, False), b"x")
    assert joined.sequence_gaps == 1


@pytest.mark.parametrize(("data", "index", "degrees", "acceleration"), FRAMES)
def test_frames(data, index, degrees, acceleration):
    (message,) = RvcParser().feed(data)
    assert message.index == index
    assert [math.degrees(a) for a in (message.yaw, message.pitch, message.roll)] == pytest.approx(
        degrees
    )
    assert message.acceleration == pytest.approx(acceleration, abs=1e-3)
    assert encode_rvc(message) == data


def test_split_everywhere_behind_the_text_of_a_reset():
    data = TEXT + DATASHEET + FRAMES[1][0]
    for cut in range(len(data) + 1):
        parser = RvcParser()
        assert [m.index for m in parser.feed(data[:cut]) + parser.feed(data[cut:])] == [222, 0]


def test_start_inside_data():
    angle = -21846 * math.radians(0.01)  # 0xAAAA
    message = RvcMessage(7, angle, angle, 0.0, (0.0, 0.0, 0.0))
    parser = RvcParser()
    data = encode_rvc(message)
    got = parser.feed(data[3:] + data + data)  # joins in the middle of a frame
    assert [m.index for m in got] == [7, 7]


def test_flipped_bit_costs_one_frame():
    damaged = bytearray(DATASHEET)
    damaged[8] ^= 0x10
    parser = RvcParser()
    assert [m.index for m in parser.feed(bytes(damaged) + FRAMES[1][0])] == [0]
    assert parser.checksum_errors == 1


def test_noise_never_raises_and_is_dropped():
    parser = RvcParser()
    parser.feed(random.Random(3).randbytes(5000))
    assert len(parser._buffer) < 19
