# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""IQUART against messages made by the vendor's library (recorded), and against damaged lines."""

import random
import struct

import pytest

from fish_hw.protocol.iquart import GET, REPLY, SAVE, SET, Message, Parser, encode


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
