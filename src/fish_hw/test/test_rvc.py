# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""UART-RVC against the datasheet's frame and two recorded ones, and against damage."""

import math
import random

import pytest

from fish_hw.protocol.rvc import RvcMessage, RvcParser, encode

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


@pytest.mark.parametrize(("data", "index", "degrees", "acceleration"), FRAMES)
def test_frames(data, index, degrees, acceleration):
    (message,) = RvcParser().feed(data)
    assert message.index == index
    assert [math.degrees(a) for a in (message.yaw, message.pitch, message.roll)] == pytest.approx(
        degrees
    )
    assert message.acceleration == pytest.approx(acceleration, abs=1e-3)
    assert encode(message) == data


def test_split_everywhere_behind_the_text_of_a_reset():
    data = TEXT + DATASHEET + FRAMES[1][0]
    for cut in range(len(data) + 1):
        parser = RvcParser()
        assert [m.index for m in parser.feed(data[:cut]) + parser.feed(data[cut:])] == [222, 0]


def test_start_inside_data():
    angle = -21846 * math.radians(0.01)  # 0xAAAA
    message = RvcMessage(7, angle, angle, 0.0, (0.0, 0.0, 0.0))
    parser = RvcParser()
    data = encode(message)
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
