# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recovery: what was whole is saved bit by bit, what was lost is said."""

import struct
from contextlib import suppress

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.records import Message as MessageRecord
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from fish_bag import RecordingError, read_trial
from fish_bag import sample_recordings as samples
from fish_bag.recover import recover


def damaged(path, change):
    file = next(path.glob("*.mcap"))
    data = bytearray(file.read_bytes())
    file.write_bytes(bytes(change(data)))
    return path


def test_complete_recording_loses_nothing(tmp_path):
    path = samples.robot_recording(tmp_path / "a")
    result = recover(path, tmp_path / "b")
    assert result.lost == ()
    assert result.count == len(samples.robot_messages())
    before, after = read_trial(path), read_trial(tmp_path / "b")
    for name, stream in before.streams.items():
        np.testing.assert_array_equal(stream.t, after.streams[name].t)
    np.testing.assert_array_equal(before.imu.gyro, after.imu.gyro)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.77, 0.9, 0.999])
def test_cut_anywhere(tmp_path, share):
    path = damaged(samples.robot_recording(tmp_path / "a"), lambda d: d[: int(len(d) * share)])
    result = recover(path, tmp_path / "b")
    assert result.lost or result.notes
    after = read_trial(tmp_path / "b")
    saved_s = (result.last_ns - samples.START_NS) * 1e-9
    expected = [m for m in samples.robot_messages() if m[0] <= result.last_ns]
    assert abs(result.count - len(expected)) <= 15  # messages of the same instant as the cut
    assert saved_s > 2.0 * share - 0.35
    t = np.arange(0, 2, 0.01)[: len(after.imu)]
    np.testing.assert_array_equal(after.imu.gyro[:, 2], t)


def test_damaged_chunk_is_skipped_and_the_rest_kept(tmp_path):
    def flip(data):
        data[data.index(b"imu_link", len(data) // 2)] ^= 0xFF
        return data

    path = damaged(samples.robot_recording(tmp_path / "a"), flip)
    result = recover(path, tmp_path / "b")
    assert "wrong checksum" in result.lost[0]
    whole = len(samples.robot_messages())
    assert 0.7 * whole < result.count < whole
    assert result.last_ns == samples.robot_messages()[-1][0]


def flipped(*positions):
    def flip(data):
        for position in positions:
            data[position] ^= 0x41
        return data

    return flip


def places(path):
    """First byte of every record: (opcode, position) as they follow each other, without the end magic."""
    data, position, found = next(path.glob("*.mcap")).read_bytes(), 8, []
    while position < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, position)
        found.append((opcode, position))
        position += 9 + length
    return found


def first(path, opcode):
    return next(position for found, position in places(path) if found == opcode)


def in_chunk(chunks):
    """The messages per chunk of a recording as the mcap package reads them."""
    return [
        sum(isinstance(record, MessageRecord) for record in breakup_chunk(chunk))
        for chunk in chunks
    ]


@pytest.mark.parametrize("place", [0, 1, 5], ids=["opcode", "length", "length far beyond the end"])
def test_a_damaged_head_of_a_chunk_costs_at_most_that_chunk(tmp_path, place):
    path = samples.robot_recording(tmp_path / "a")
    with (path / "a.mcap").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
    lost = in_chunk([record for record in records if isinstance(record, Chunk)])[1]
    chunks = [position for opcode, position in places(path) if opcode == Opcode.CHUNK]
    damaged(path, flipped(chunks[1] + place))
    result = recover(path, tmp_path / "b")
    gone = len(samples.robot_messages()) - result.count
    assert gone == (lost if place == 0 else 0)  # the length stands in the chunk a second time
    assert bool(result.lost) == (place == 0)


def test_definitions_damaged_in_the_data_come_from_the_summary(tmp_path):
    path = samples.robot_recording(tmp_path / "a")
    chunks = [position for opcode, position in places(path) if opcode == Opcode.CHUNK]
    result = recover(damaged(path, flipped(chunks[0] + 80)), tmp_path / "b")
    assert result.count > 0.8 * len(samples.robot_messages())
    assert "wrong checksum" in result.lost[0]


def test_definitions_damaged_in_the_summary_come_from_the_data(tmp_path):
    path = samples.robot_recording(tmp_path / "a")
    in_summary = [position for opcode, position in places(path) if opcode == Opcode.CHANNEL][-1]
    result = recover(damaged(path, flipped(in_summary + 18)), tmp_path / "b")
    assert result.count == len(samples.robot_messages())
    assert result.lost == ()
    assert result.notes == ("a.mcap: the index is cut off or damaged; no message is lost",)


def test_messages_whose_channel_is_lost_are_counted(tmp_path):
    path = samples.robot_recording(tmp_path / "a")
    chunks = [position for opcode, position in places(path) if opcode == Opcode.CHUNK]
    end = first(path, Opcode.DATA_END)
    damaged(path, lambda data: flipped(chunks[0] + 80)(data)[:end])
    with pytest.raises(RecordingError, match="messages of channel 1, whose topic or type is lost"):
        recover(path, tmp_path / "b")


def test_any_damaged_byte_is_survived(tmp_path):
    """A trial or a RecordingError, and a recovery that can be read; half of the bytes where the file's structure lies."""
    whole, count = (
        samples.robot_recording(tmp_path / "whole", duration=1.0),
        len(samples.robot_messages(1.0)),
    )
    data, rng = next(whole.glob("*.mcap")).read_bytes(), np.random.default_rng(5)
    structure = [
        *range(first(whole, Opcode.CHUNK)),
        *range(first(whole, Opcode.DATA_END), len(data)),
    ]
    for i in range(24):
        at = int(rng.choice(structure) if i % 2 else rng.integers(len(data)))
        broken = bytearray(data)
        broken[at] = rng.choice([0, 255, broken[at] ^ 1 << int(rng.integers(8))])
        (tmp_path / f"{i}.mcap").write_bytes(bytes(broken))
        with suppress(RecordingError):
            read_trial(tmp_path / f"{i}.mcap")
        result = recover(tmp_path / f"{i}.mcap", tmp_path / f"{i}")
        assert result.count > 0.3 * count
        read_trial(tmp_path / f"{i}")


def test_compressed_chunk_that_is_cut(tmp_path):
    writer = Writer2(tmp_path / "a", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    store, count = samples.typestore(), 20_000
    with writer:
        imu = writer.add_connection("/fish/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        for i in range(count):
            message = samples.build.imu(
                samples.ns(0.01 * i), (0.1, 0.2, 0.01 * i), (0, 0, 9.81), (0, 0, 0, 1)
            )
            raw = bytes(store.serialize_cdr(message, "sensor_msgs/msg/Imu"))
            writer.write(imu, samples.ns(0.01 * i), raw)
    path = damaged(tmp_path / "a", lambda d: d[: int(len(d) * 0.6)])
    result = recover(path, tmp_path / "b")
    assert 0.3 * count < result.count < 0.8 * count
    np.testing.assert_allclose(
        read_trial(tmp_path / "b").imu.gyro[:, 2], 0.01 * np.arange(result.count)
    )


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"not mcap at all" * 100])
def test_nothing_to_save(tmp_path, content):
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(RecordingError, match="nothing to save"):
        recover(tmp_path / "a.mcap", tmp_path / "b")
    assert not (tmp_path / "b").exists()
