# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""SHTP and SH-2 against recorded packets (parsed by the vendor's example library) and against damage."""

import math
import struct

import pytest

from fish_hw.protocol import sh2
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
