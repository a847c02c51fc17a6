# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Readers of every format: their layouts, odd files, and topics of other names."""

import bz2
import gzip
import lzma
import os
import shutil
import sqlite3
import struct
import zlib
from collections import Counter
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

from fish_bag import RecordingError, TopicMap, load_topic_map, read_dataset, read_trial
from fish_bag import message_build as build
from fish_bag import sample_recordings as samples
from fish_bag.bag import salvage_bag
from fish_bag.layout import MAX_LAYOUTS, LayoutError, decode_blocks, find_layout
from fish_bag.message_types import message_type, typestore
from fish_bag.recover import recover
from fish_bag.sample_recordings import WRITERS
from fish_bag.storage import LEAST_LIMIT, unpack, unpack_pieces
from fish_bag.topic_map import DEFAULT_RULES, TopicRule


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The same messages in every format."""
    folder, messages = tmp_path_factory.mktemp("formats"), samples.robot_messages()
    return {
        form: write(folder / form.replace(" ", "_"), messages) for form, write in WRITERS.items()
    }


@pytest.mark.parametrize("form", WRITERS)
def test_values_and_times(sources, form):
    trial = read_trial(sources[form])
    kinds = {"storage"} if form == "sqlite3 log" else set()  # the log and what it adds are named
    assert {p.kind for p in trial.problems if p.severity != "info"} == kinds
    assert (trial.namespace, trial.axis, trial.origin_ns) == ("/fish", "recorder", samples.START_NS)
    t = np.arange(0, 2, 0.01)
    for stream, latency in ((trial.commands, 0.0), (trial.encoder, 0.001), (trial.imu, 0.002)):
        np.testing.assert_allclose(stream.t, t, atol=2e-9)
        np.testing.assert_allclose(stream.t_arrival - stream.t, latency, atol=2e-9)
    np.testing.assert_array_equal(trial.commands.rotor_speed, samples.rotor_speed(t))
    np.testing.assert_array_equal(trial.commands.rotor_phase, samples.phase(t))
    np.testing.assert_array_equal(trial.commands.rudder, samples.rudder(t))
    np.testing.assert_array_equal(trial.encoder.angle, 0.5 * t)
    np.testing.assert_array_equal(trial.encoder.speed, samples.rotor_speed(t) - 0.5)
    np.testing.assert_array_equal(trial.imu.gyro, np.column_stack([0.1 + 0 * t, 0.2 + 0 * t, t]))
    np.testing.assert_array_equal(trial.imu.accel[:, 1], t)
    np.testing.assert_array_equal(trial.imu.orientation[0], [0, 0, 0.6, 0.8])
    tc = np.arange(0.005, 2, 1 / 30)
    np.testing.assert_allclose(trial.camera.t, tc, atol=2e-9)
    np.testing.assert_allclose(trial.camera.pose, samples.pose(tc), atol=1e-12)
    np.testing.assert_array_equal(trial.camera.covariance[0], np.diag([4e-6, 4e-6, 1.44e-4]))
    assert trial.tail.names == ("tail_1", "tail_2")
    np.testing.assert_allclose(trial.tail.angle, np.column_stack([0.1 * tc, -0.2 * tc]))
    np.testing.assert_allclose(trial.odometry.pose, samples.pose(t), atol=1e-12)
    np.testing.assert_allclose(trial.odometry.v, 0.01 * t)
    assert trial.gains.names == ("p", "i", "d", "p2", "i2", "d2")
    np.testing.assert_allclose(trial.gains.values[:, 5], np.arange(0, 2, 0.02))
    np.testing.assert_allclose(trial.target.course, 0.5)
    np.testing.assert_array_equal(trial.tracking_error.heading, 0.02)
    np.testing.assert_array_equal(trial.reference_path, [[0, 0], [1, 0.5], [1.5, 0.5]])
    assert trial.reference_speed.speed.tolist() == [0.2]
    np.testing.assert_allclose(trial.battery.voltage, [12.0, 11.9], atol=1e-6)


def test_custom_data_and_counts(sources):
    trial = read_trial(sources["own"])
    assert trial.metadata == {"robot": "test fish"}
    by_topic = {topic.topic: topic for topic in trial.topics}
    imu = by_topic["/fish/imu/data"]
    assert (imu.count, imu.role, imu.stamped) == (200, "imu", True)
    assert imu.rate_hz == pytest.approx(100, rel=1e-6)
    np.testing.assert_allclose(imu.latency_s, 0.002, atol=1e-8)
    assert by_topic["/fish/control/gains"].stamped is False


def test_a_stamp_of_zero_is_none(tmp_path):
    points = np.array([[0.0, 0.0], [1.0, 0.5]])
    messages = [
        (arrival, topic, build.path(0, "pool", points) if topic.endswith("/path") else message)
        for arrival, topic, message in samples.robot_messages()
    ]
    trial = read_trial(samples.write_mcap(tmp_path / "trial", messages))
    (topic,) = (t for t in trial.topics if t.topic.endswith("reference/path"))
    assert (topic.count, topic.stamped) == (1, False)
    assert np.isnan(topic.latency_s).all()


def test_arrival_times_by_map(sources):
    rules = dict(DEFAULT_RULES) | {"imu": TopicRule("imu/data", time="arrival")}
    trial = read_trial(sources["own"], TopicMap(rules))
    np.testing.assert_allclose(trial.imu.t, np.arange(0, 2, 0.01) + 0.002, atol=2e-9)


def test_other_names_by_map(tmp_path):
    messages = samples.robot_messages(0.5, namespace="/robots/seven")
    messages = [(t, topic.replace("imu/data", "sensors/imu"), m) for t, topic, m in messages]
    rules = dict(DEFAULT_RULES) | {"imu": TopicRule("/robots/seven/sensors/imu", frame="imu_link")}
    trial = read_trial(samples.write_mcap(tmp_path / "a", messages), TopicMap(rules))
    assert trial.namespace == "/robots/seven"
    assert len(trial.imu) == 50


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda p: p / "nothing", "does not exist"),
        (lambda p: _file(p / "empty.mcap", b""), "empty"),
        (lambda p: _file(p / "notes.txt", b"hello"), "not a recording"),
        (lambda p: _file(p / "junk.mcap", b"hello world" * 50), "damaged.*nothing is left"),
        (lambda p: _file(p / "junk.bag", b"hello world" * 50), "damaged.*nothing is left"),
        (lambda p: _file(p / "junk.db3", b"hello world" * 50), "damaged.*nothing is left"),
        (lambda p: samples.write_mcap(p / "none", []), "no messages"),
        (lambda p: _truncated(p), "robofish recover"),
        (lambda p: _file(p / "folder" / "metadata.yaml", b"a: ["), "no storage file"),
    ],
)
def test_unreadable_recordings_say_why(tmp_path, make, text):
    path = make(tmp_path)
    with pytest.raises(RecordingError, match=text) as error:
        read_trial(path)
    assert "Traceback" not in str(error.value)
    assert str(tmp_path) in str(error.value)


def test_foreign_recording_lists_what_it_holds(tmp_path):
    path = samples.write_mcap(tmp_path / "a", [(1, "/lidar/range", samples.build.number(1.0))])
    with pytest.raises(RecordingError, match=r"/lidar/range \(std_msgs/msg/Float64\)"):
        read_trial(path)


def test_two_robots_in_one_recording(tmp_path):
    both = samples.robot_messages(0.2, "/fish") + samples.robot_messages(0.2, "/carp")
    path = samples.write_mcap(tmp_path / "a", sorted(both, key=lambda m: m[0]))
    with pytest.raises(RecordingError, match="2 robots"):
        read_trial(path)
    assert len(read_trial(path, TopicMap(namespace="/carp")).commands) == 20


def _file(path, data):
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(data)
    return path if path.name != "metadata.yaml" else path.parent


def _truncated(folder):
    path = samples.robot_recording(folder / "cut")
    file = path / "cut.mcap"
    file.write_bytes(file.read_bytes()[:50_000])
    return path


POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:aa\nsize 130\n"
MESSAGES = samples.robot_messages(0.3)
ROBOT = Counter(topic for _, topic, _ in MESSAGES)
FOREIGN = "/other/thing"


def write(path, foreign=None, **options):
    """An MCAP file of the mcap package; `foreign` is topic, type, encoding and bytes of one message."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2048, **options)
        writer.start("ros2", "sample")
        channels = {}
        if foreign is not None:
            topic, kind, encoding, raw = foreign
            schema = writer.register_schema(kind, "odd", b"odd")
            channel = writer.register_channel(topic, encoding, schema)
            writer.add_message(channel, MESSAGES[0][0], raw, MESSAGES[0][0])
        for time_ns, topic, message in MESSAGES:
            kind = message_type(message.__msgtype__)
            if topic not in channels:
                schema = writer.register_schema(kind.name, kind.encoding, kind.definition)
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            raw = bytes(typestore().serialize_cdr(message, kind.name))
            writer.add_message(channels[topic], time_ns, raw, time_ns)
        writer.finish()
    return path


def records(data):
    """Place, opcode and body of every record."""
    position = 8
    while position < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, position)
        yield position, opcode, data[position + 9 : position + 9 + length]
        position += 9 + length


def rewritten(path, change):
    """The file with `change(opcode, body)` in place of every record."""
    data, out = path.read_bytes(), []
    for _, opcode, body in records(data):
        for kind, new in change(opcode, body):
            out.append(struct.pack("<BQ", kind, len(new)) + new)
    path.write_bytes(data[:8] + b"".join(out) + data[-8:])
    return path


def holds_the_robot(trial):
    found = {topic.topic: topic.count for topic in trial.topics}
    assert {topic: found.get(topic) for topic in ROBOT} == ROBOT
    return " ".join(problem.text for problem in trial.problems)


@pytest.mark.parametrize("inside", [0, 1, 100])
def test_a_summary_that_begins_inside_the_data_hides_nothing(tmp_path, inside):
    path = write(tmp_path / "a.mcap", enable_crcs=False)
    data = bytearray(path.read_bytes())
    third = [place for place, opcode, _ in records(data) if opcode == Opcode.CHUNK][2] + inside
    struct.pack_into("<Q", data, len(data) - 8 - 20, third)  # summary_start of the footer
    path.write_bytes(data)
    assert "no message is lost" in holds_the_robot(read_trial(path))


@pytest.mark.parametrize("by_channel", [True, False])
def test_a_total_that_does_not_fit_is_said(tmp_path, by_channel):
    def change(opcode, body):
        if opcode != Opcode.STATISTICS:
            return [(opcode, body)]
        times = body[:42]  # all up to the counts of the channels
        return [(opcode, struct.pack("<Q", 7) + (body[8:] if by_channel else times[8:] + bytes(4)))]

    path = rewritten(write(tmp_path / "a.mcap", enable_crcs=False), change)
    assert "its statistics say 7" in holds_the_robot(read_trial(path))


def test_records_of_unknown_kinds_are_left_out_and_said(tmp_path):
    def change(opcode, body):
        return [(0x91, b"x" * 50), (opcode, body)] if opcode == Opcode.CHUNK else [(opcode, body)]

    path = rewritten(write(tmp_path / "a.mcap"), change)
    assert "0x91" in holds_the_robot(read_trial(path))


def test_reserved_records_in_a_row_are_left_out_and_said(tmp_path):
    """The specification has readers skip opcodes of later versions, however many follow each other."""

    def change(opcode, body):
        strange = [(0x7F, b"x" * 50), (0x10, b""), (0x90, b"y")]
        return [*strange, (opcode, body)] if opcode == Opcode.CHUNK else [(opcode, body)]

    path = rewritten(write(tmp_path / "a.mcap", enable_crcs=False), change)
    data = bytearray(path.read_bytes())
    first = next(place for place, opcode, _ in records(data) if opcode == Opcode.DATA_END) + 13
    struct.pack_into("<Q", data, len(data) - 28, first)  # where the summary begins now
    path.write_bytes(data)
    assert "0x10" in holds_the_robot(read_trial(path))


PACKERS = {
    "zstd": zstandard.ZstdCompressor().compress,
    "zstd without its size": zstandard.ZstdCompressor(write_content_size=False).compress,
    "lz4": lz4.frame.compress,
    "bz2": bz2.compress,
}


@pytest.mark.parametrize("packer", PACKERS)
def test_no_more_is_unpacked_than_was_stated(packer):
    name, pack = packer.split()[0], PACKERS[packer]
    packed = pack(bytes(LEAST_LIMIT + 1))
    with pytest.raises(ValueError, match="unpacks to"):
        unpack(name, packed, 1000)
    data, whole = unpack(name, packed, LEAST_LIMIT + 1)
    assert (len(data), whole) == (LEAST_LIMIT + 1, True)


@pytest.mark.parametrize("packer", PACKERS)
def test_pieces_are_what_was_packed(packer):
    name, pack = packer.split()[0], PACKERS[packer]
    data = [np.random.default_rng(k).bytes(5000 + k) for k in range(3)]
    packed = b"".join(map(pack, data))
    for piece in (0, 1, 77, len(packed)):
        parts = list(unpack_pieces(name, packed, piece))
        assert b"".join(part for part, _ in parts) == b"".join(data)
        assert parts[-1][1]
    assert not list(unpack_pieces(name, packed[:-1]))[-1][1]


@pytest.mark.parametrize("cut", [0, 40])
def test_a_packed_file_is_unpacked_into_a_file(tmp_path, cut):
    content = PACKERS["zstd"](write(tmp_path / "a.mcap").read_bytes())
    path = tmp_path / "packed.mcap.zst"
    path.write_bytes(content[: len(content) - cut])
    if not cut:
        holds_the_robot(read_trial(path))
        return
    with pytest.raises(RecordingError, match="the end of what zstd packed"):
        read_trial(path)


def test_an_unknown_compression_of_a_chunk_is_named(tmp_path):
    path = write(tmp_path / "a.mcap", compression=CompressionType.ZSTD)
    name = struct.pack("<I", 4) + b"zstd"
    path.write_bytes(path.read_bytes().replace(name, name[:4] + b"brot", 1))
    with pytest.raises(RecordingError, match="compressed as 'brot', which is not known"):
        read_trial(path)


def test_a_channel_without_its_schema_harms_no_other(tmp_path):
    options = {"use_chunking": False, "repeat_schemas": False, "use_statistics": False}
    foreign = (FOREIGN, "a/msg/Odd", "cdr", b"\0\1\0\0abcd")
    path = write(tmp_path / "a.mcap", foreign, enable_crcs=False, **options)
    rewritten(path, lambda o, b: [] if o == Opcode.SCHEMA and b"a/msg/Odd" in b else [(o, b)])
    assert "1 messages of an unknown type" in holds_the_robot(read_trial(path))
    recover(path, tmp_path / "out")
    holds_the_robot(read_trial(tmp_path / "out"))


def test_the_checksum_of_data_without_chunks(tmp_path):
    path = write(tmp_path / "a.mcap", use_chunking=False, enable_data_crcs=True)
    holds_the_robot(read_trial(path))
    data = bytearray(path.read_bytes())
    place = [place for place, opcode, _ in records(data) if opcode == Opcode.MESSAGE][40]
    data[place + 70] ^= 4
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="checksum of its data"):
        read_trial(path)
    assert recover(path, tmp_path / "out").lost


@pytest.mark.parametrize("topic", ["/other/imu/data", "/other/joint_command"])
def test_a_foreign_topic_with_a_robots_name_is_no_second_robot(tmp_path, topic):
    trial = read_trial(write(tmp_path / "a.mcap", (topic, "foxglove.Imu", "protobuf", b"\x08\x01")))
    assert trial.namespace == "/fish"
    holds_the_robot(trial)


def test_the_same_topic_in_another_serialisation_hides_nothing(tmp_path):
    foreign = ("/fish/imu/data", "sensor_msgs/msg/Imu", "protobuf", b"\x08\x01")
    trial = read_trial(write(tmp_path / "a.mcap", foreign))
    assert len(trial.imu) == ROBOT["/fish/imu/data"]
    assert [p.kind for p in trial.problems if p.severity == "error"] == ["serialization"]


def stated(path, **changes):
    """A sqlite3 recording with changed fields in metadata.yaml."""
    samples.write_rosbag2(path, MESSAGES, samples.SQLITE)
    document = yaml.safe_load((path / "metadata.yaml").read_text())
    document["rosbag2_bagfile_information"] |= changes
    (path / "metadata.yaml").write_text(yaml.safe_dump(document))
    return path


def test_a_file_that_is_named_twice_is_read_once(tmp_path):
    path = stated(tmp_path / "a", relative_file_paths=["a.db3", "a/a.db3"])
    assert "names a file twice" in holds_the_robot(read_trial(path))


def test_the_total_of_metadata_is_compared(tmp_path):
    path = stated(tmp_path / "a", message_count=7)
    assert "metadata.yaml says 7" in holds_the_robot(read_trial(path))


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("a.mcap", gzip.compress(b"mcap"), "a gzip file, not a recording; gunzip it"),
        ("a.mcap.gz", gzip.compress(b"mcap"), "a gzip file"),
        ("a.db3", bz2.compress(b"db3"), "a bzip2 file"),
        ("a.mcap", lzma.compress(b"mcap"), "an xz file"),
        ("a.zip", b"PK\3\4" + bytes(40), "a zip archive"),
        ("a.bag", b"/annex/objects/SHA256E-s1--aa.bag\n", "a git-annex pointer"),
        ("a.mcap", b"\x89MCAP0\n" + bytes(40), "whose line ends were changed"),
        ("a.mcap", b"\x89MCAP0\r\r\n" + bytes(40), "whose line ends were changed"),
        ("a.mcap", b"\n<!doctype html><html>404</html>", "a web page"),
    ],
)
def test_a_file_that_is_something_else_is_named(tmp_path, name, data, said):
    (tmp_path / name).write_bytes(data)
    for read in (read_trial, salvage_bag):
        with pytest.raises(RecordingError, match=said):
            read(tmp_path / name)


def test_what_is_neither_file_nor_folder_costs_itself_only(tmp_path):
    for name in ("a.mcap", "c.mcap"):
        write(tmp_path / name)
    os.mkfifo(tmp_path / "b.mcap")
    with pytest.raises(RecordingError, match="neither a file nor a folder"):
        read_trial(tmp_path / "b.mcap")
    data = read_dataset(tmp_path)
    holds_the_robot(data.trials[0])
    assert any("b.mcap left out" in problem.text for problem in data.problems)
    assert len(data) == 2


def test_a_second_file_behind_the_first_is_said(tmp_path):
    path = write(tmp_path / "a.mcap")
    path.write_bytes(2 * path.read_bytes())
    with pytest.raises(RecordingError, match="another MCAP file begins at byte"):
        read_trial(path)
    recover(path, tmp_path / "out")
    holds_the_robot(read_trial(tmp_path / "out"))


def test_no_message_that_reaches_into_erased_flash_is_saved(tmp_path):
    path = write(tmp_path / "a.mcap", use_chunking=False)
    data = path.read_bytes()
    held = Counter(body[22:] for _, o, body in records(data) if o == Opcode.MESSAGE)
    places = [place for place, opcode, _ in records(data) if opcode == Opcode.MESSAGE][40:44]
    for cut in range(places[0], places[-1]):
        path.write_bytes(data[:cut] + b"\xff" * 4096)
        saved = salvage_bag(path)
        assert not Counter(raw for topic in saved.topics for raw in topic.raws) - held
        assert saved.lost


@pytest.mark.parametrize("name", ["trial_03", "SQLITE3", "2026_11_27"])
def test_a_number_in_a_name_is_no_part(tmp_path, name):
    path = samples.write_rosbag2(tmp_path / name, MESSAGES, samples.SQLITE)
    (path / "metadata.yaml").unlink()
    assert holds_the_robot(read_trial(path)) == ""


def test_names_in_capitals_and_files_of_macos(tmp_path):
    path = stated(tmp_path / "a", relative_file_paths=["a.DB3"])
    (path / "a.db3").rename(path / "a.DB3")
    (path / "._a.db3").write_bytes(b"\0\5\x16\7" + bytes(100))
    assert holds_the_robot(read_trial(path)) == ""
    (path / "metadata.yaml").unlink()
    holds_the_robot(read_trial(path))


def test_the_count_of_every_file_is_compared(tmp_path):
    files = [{"path": "a.db3", "message_count": 7}, {"path": "gone.db3", "message_count": 3}]
    said = holds_the_robot(read_trial(stated(tmp_path / "a", files=files)))
    assert f"a.db3: {len(MESSAGES)} messages were read, metadata.yaml says 7" in said
    odd = [None, {"path": 3}, {"message_count": "many"}]
    assert "were read" not in holds_the_robot(read_trial(stated(tmp_path / "b", files=odd)))


@pytest.mark.parametrize("named", [["a_0.db3"], None])
def test_a_part_in_two_formats_is_read_once(tmp_path, named):
    path = stated(tmp_path / "a", relative_file_paths=named)
    (path / "a.db3").rename(path / "a_0.db3")
    write(path / "a_0.mcap")
    if named is None:
        (path / "metadata.yaml").unlink()
    assert "a_0.mcap not read" in holds_the_robot(read_trial(path))


def test_a_missing_part_is_said(tmp_path):
    (tmp_path / "a").mkdir()
    write(tmp_path / "a" / "a_0.mcap")
    shutil.copy(tmp_path / "a" / "a_0.mcap", tmp_path / "a" / "a_2.mcap")
    assert any(
        "part 1 is not there" in problem.text for problem in read_trial(tmp_path / "a").problems
    )


def test_metadata_that_is_a_pointer_is_named(tmp_path):
    path = stated(tmp_path / "a")
    (path / "metadata.yaml").write_text(POINTER)
    assert "Git LFS pointer" in holds_the_robot(read_trial(path))


def with_log(folder, change=lambda data: data):
    """A recording in a write-ahead log that is damaged, and its messages without damage."""
    path = samples.write_sqlite_with_log(folder / "a", MESSAGES)
    log = next(path.glob("*-wal"))
    log.write_bytes(change(log.read_bytes()))
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: POINTER.encode(), "Git LFS pointer"),
        (lambda data: data[: len(data) // 2], "are damaged"),
        (lambda data: data[:-1], "are damaged"),
        (lambda data: data[: len(data) // 2] + bytes(len(data) - len(data) // 2), "are damaged"),
        (lambda data: data[:9000] + bytes([data[9000] ^ 1]) + data[9001:], "are damaged"),
        (lambda data: data[:17] + bytes([data[17] ^ 1]) + data[18:], "its head is damaged"),
        (lambda data: data[:20], "its head is cut"),
    ],
    ids=["pointer", "half", "last byte", "zeros", "flip", "salt", "head"],
)
def test_what_a_damaged_log_takes_is_said(tmp_path, change, words):
    whole = salvage_bag(with_log(tmp_path / "whole"))
    path = with_log(tmp_path / "damaged", change)
    with pytest.raises(RecordingError, match=words):
        read_trial(path)
    assert words in recover(path, tmp_path / "out").lost[0]
    left = salvage_bag(tmp_path / "out")
    before, after = (
        Counter((raw.topic, message) for raw in bag.topics for message in raw.raws)
        for bag in (whole, left)
    )
    assert not after - before, "a message is invented"
    assert after.total() >= before.total() // 2


def test_what_is_whole_in_a_cut_log_is_saved(tmp_path):
    path = with_log(tmp_path, lambda data: data[:-1])
    assert recover(path, tmp_path / "out").count > 0.8 * len(MESSAGES)


@pytest.mark.parametrize("logged", [True, False])
@pytest.mark.parametrize("cut", [0, 3000])
def test_a_log_of_another_recording_is_named_and_left_out(tmp_path, logged, cut):
    foreign = [(time_ns + 10**12, topic, message) for time_ns, topic, message in MESSAGES]
    other = samples.write_sqlite_with_log(tmp_path / "other", foreign)
    path = samples.write_rosbag2(tmp_path / "mine", MESSAGES, samples.SQLITE)
    if logged:
        connection = sqlite3.connect(path / "mine.db3")
        connection.execute("PRAGMA journal_mode=WAL")
        connection.close()
    log = next(other.glob("*-wal")).read_bytes()
    (path / "mine.db3-wal").write_bytes(log[: len(log) - cut])
    with pytest.raises(RecordingError, match=r"mine\.db3-wal belongs to another database"):
        read_trial(path)
    recover(path, tmp_path / "out")
    holds_the_robot(read_trial(tmp_path / "out"))


def test_fields_of_a_later_mcap_version_are_ignored(tmp_path):
    """The specification has new fields at a record's end, which readers ignore."""

    def longer(opcode, body):
        return [(opcode, body if opcode == Opcode.MESSAGE else body + b"new!")]

    def inside(opcode, body):
        if opcode != Opcode.CHUNK:
            return longer(opcode, body)
        packed = struct.unpack_from("<Q", body, 32)[0]
        assert len(body) == 40 + packed
        held = b"".join(
            struct.pack("<BQ", kind, len(new)) + new
            for _, o, b in records(bytes(8) + body[40:] + bytes(8))
            for kind, new in longer(o, b)
        )
        head = body[:16] + struct.pack("<QIIQ", len(held), zlib.crc32(held), 0, len(held))
        return longer(opcode, head + held)

    for name, change, options in (
        ("outside", longer, {"use_chunking": False}),
        ("inside", inside, {"compression": CompressionType.NONE}),
    ):
        path = rewritten(write(tmp_path / f"{name}.mcap", enable_crcs=False, **options), change)
        holds_the_robot(read_trial(path))


def test_a_log_without_its_database_is_named(tmp_path):
    path = with_log(tmp_path)
    (path / "a.db3").unlink()
    with pytest.raises(RecordingError, match=r"a\.db3-wal belongs to a database that is not there"):
        read_trial(path)


def test_old_pages_behind_the_log_are_no_damage(tmp_path):
    path = samples.write_rosbag2(tmp_path / "a", MESSAGES, samples.SQLITE)
    file = path / "a.db3"
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA journal_mode=WAL")
    insert = "INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp, data FROM messages"
    connection.execute(f"{insert} WHERE id <= 100")
    connection.commit()
    connection.execute("PRAGMA wal_checkpoint(PASSIVE)")
    connection.execute(f"{insert} WHERE id <= 1")
    connection.commit()
    kept = {end: (path / f"a.db3{end}").read_bytes() for end in ("", "-wal")}
    connection.close()
    for end, data in kept.items():
        (path / f"a.db3{end}").write_bytes(data)
    assert salvage_bag(path).count == len(MESSAGES) + 101


def test_rows_whose_time_is_no_number_are_said(tmp_path):
    path = stated(tmp_path / "a")
    connection = sqlite3.connect(path / "a.db3")
    connection.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (1, 'soon', x'00')")
    connection.commit()
    connection.close()
    with pytest.raises(RecordingError, match="no whole number"):
        read_trial(path)
    recover(path, tmp_path / "out")
    holds_the_robot(read_trial(tmp_path / "out"))


def test_a_link_to_a_database_brings_its_log(tmp_path):
    path = samples.write_sqlite_with_log(tmp_path / "a", MESSAGES)
    (tmp_path / "link.db3").symlink_to(path / "a.db3")
    assert "a.db3-wal is taken in" in holds_the_robot(read_trial(tmp_path / "link.db3"))


def test_a_database_of_another_program_is_named(tmp_path):
    with closing(sqlite3.connect(tmp_path / "a.db3")) as connection:
        connection.execute("CREATE TABLE birds (name)")
        connection.commit()
    for read in (read_trial, salvage_bag):
        with pytest.raises(RecordingError, match="with the tables birds, not a recording"):
            read(tmp_path / "a.db3")


TYPES = {
    "sensor_msgs/msg/JointState": lambda r, n: build.joints(
        r.integers(1, 2**60),
        ["rotor", "rudder", "x"][: n % 4],
        r.normal(size=n % 4),
        r.normal(size=n % 3),
    ),
    "sensor_msgs/msg/Imu": lambda r, _n: build.imu(
        r.integers(1, 2**60), r.normal(size=3), r.normal(size=3), r.normal(size=4)
    ),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda r, n: build.camera_pose(
        r.integers(1, 2**60), "p" * (n % 9), r.normal(size=3), r.uniform(size=3)
    ),
    "nav_msgs/msg/Odometry": lambda r, _n: build.odometry(
        r.integers(1, 2**60), r.normal(size=3), r.normal(size=3)
    ),
    "sensor_msgs/msg/BatteryState": lambda r, _n: build.battery(
        r.integers(1, 2**60), r.uniform(9, 12)
    ),
    "std_msgs/msg/Float64MultiArray": lambda r, n: build.labelled_numbers(
        "a" * (n % 6), r.normal(size=n % 7)
    ),
    "nav_msgs/msg/Path": lambda r, n: build.path(
        r.integers(1, 2**60), "pool", r.normal(size=(n % 5, 2))
    ),
    "std_msgs/msg/Float64": lambda r, _n: build.number(r.normal()),
}


def flatten(message, prefix=""):
    """Path -> value of every field of a rosbags message object, in the decoder's naming."""
    store = typestore()
    for name, (kind, what) in store.fielddefs[message.__msgtype__][1]:
        value, path = getattr(message, name), f"{prefix}{name}"
        if kind == Nodetype.NAME:
            yield from flatten(value, f"{path}.")
        elif kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) and what[0][0] == Nodetype.NAME:
            for i, item in enumerate(value):
                yield from flatten(item, f"{path}.{i}.")
        else:
            yield path, value


@pytest.mark.parametrize("msgtype", TYPES)
@pytest.mark.parametrize("little_endian", [True, False])
def test_agrees_with_rosbags(msgtype, little_endian):
    rng = np.random.default_rng(3)
    store = typestore()
    sent = [TYPES[msgtype](rng, n) for n in range(40)]
    raws = [bytes(store.serialize_cdr(m, msgtype, little_endian=little_endian)) for m in sent]
    blocks, bad = decode_blocks(raws, msgtype, store.fielddefs)
    assert not len(bad)
    assert sorted(np.concatenate([b.index for b in blocks]).tolist()) == list(range(40))
    for block in blocks:
        for row, i in enumerate(block.index):
            for path, value in flatten(store.deserialize_cdr(raws[i], msgtype)):
                if isinstance(value, str) or (isinstance(value, list) and path in block.texts):
                    assert block.texts[path] == ([value] if isinstance(value, str) else value)
                else:
                    np.testing.assert_array_equal(block.values[path][row], value, err_msg=path)


def test_padding_bytes_do_not_split_layouts():
    """Other DDS implementations leave garbage in alignment padding."""
    store = typestore()
    raw = bytearray(
        store.serialize_cdr(build.joints(5, ["rotor"], [1.0], [2.0]), "sensor_msgs/msg/JointState")
    )
    other = bytearray(raw)
    other[4 + 13] = 0xAB  # behind the empty frame_id, before the next length
    blocks, bad = decode_blocks(
        [bytes(raw), bytes(other)], "sensor_msgs/msg/JointState", store.fielddefs
    )
    assert len(blocks) == 1
    assert not len(bad)


@pytest.mark.parametrize("cut", [0, 3, 10, 50, 90])
def test_short_messages_are_named_not_read(cut):
    store = typestore()
    raw = bytes(
        store.serialize_cdr(build.joints(5, ["rotor"], [1.0], [2.0]), "sensor_msgs/msg/JointState")
    )
    if cut >= len(raw):
        pytest.skip("cut beyond the message")
    blocks, bad = decode_blocks(
        [raw, raw[:cut], raw], "sensor_msgs/msg/JointState", store.fielddefs
    )
    assert bad.tolist() == [1]
    assert blocks[0].index.tolist() == [0, 2]


def test_layouts_beyond_the_limit_are_left_out():
    store, msgtype = typestore(), "std_msgs/msg/Float64MultiArray"
    raws = [
        bytes(store.serialize_cdr(build.labelled_numbers(f"{n:04d}", [1.0]), msgtype))
        for n in range(MAX_LAYOUTS + 3)
    ]
    blocks, bad = decode_blocks([*raws, raws[0]], msgtype, store.fielddefs)
    assert len(blocks) == MAX_LAYOUTS
    assert blocks[0].index.tolist() == [0, MAX_LAYOUTS + 3]
    assert bad.tolist() == [MAX_LAYOUTS, MAX_LAYOUTS + 1, MAX_LAYOUTS + 2]


def test_absurd_length_is_refused():
    store = typestore()
    raw = bytearray(
        store.serialize_cdr(build.joints(5, ["rotor"], [1.0], [2.0]), "sensor_msgs/msg/JointState")
    )
    raw[4 + 8 : 4 + 12] = b"\xff\xff\xff\x7f"  # frame_id of 2 GB
    with pytest.raises(LayoutError, match="fields need more"):
        find_layout(bytes(raw), "sensor_msgs/msg/JointState", store.fielddefs, ros1=False)


@pytest.mark.parametrize(
    "definition",
    [
        "sensor_msgs/Imu x",
        f"sensor_msgs/Foo[1000000000] x\n{'=' * 80}\nMSG: sensor_msgs/Foo\n",
        f"sensor_msgs/Foo a\nsensor_msgs/Foo b\n{'=' * 80}\nMSG: sensor_msgs/Foo\nsensor_msgs/Imu y\nsensor_msgs/Imu z",
    ],
    ids=["itself", "many empty ones", "two of each other"],
)
def test_types_without_end_or_fields_are_refused(definition):
    types = get_types_from_msg(definition, "sensor_msgs/msg/Imu")
    with pytest.raises(LayoutError, match="no end or no fields"):
        find_layout(bytes([0, 1, 0, 0]) + bytes(40), "sensor_msgs/msg/Imu", types, ros1=False)


def test_ros1_layout_has_no_alignment():
    store = typestore(ros1=True)
    types = store.types
    time = types["builtin_interfaces/msg/Time"](sec=7, nanosec=8)
    header = types["std_msgs/msg/Header"](seq=3, stamp=time, frame_id="abc")
    joint = types["sensor_msgs/msg/JointState"](
        header=header,
        name=["rotor"],
        position=np.array([1.5]),
        velocity=np.array([2.5]),
        effort=np.zeros(0),
    )
    raw = bytes(store.serialize_ros1(joint, "sensor_msgs/msg/JointState"))
    blocks, bad = decode_blocks(
        [raw, raw], "sensor_msgs/msg/JointState", store.fielddefs, ros1=True
    )
    assert not len(bad)
    assert blocks[0].values["position"].tolist() == [[1.5], [1.5]]
    assert blocks[0].values["header.stamp.sec"].tolist() == [7, 7]
    assert blocks[0].texts["name"] == ["rotor"]


FILE = Path(__file__).parents[1] / "config" / "topics.yaml"


def test_file_holds_the_defaults():
    assert load_topic_map(FILE) == TopicMap()
    written = yaml.safe_load(FILE.read_text())
    assert set(written) == {"namespace", "max_latency_s", "topics"}
    assert written["topics"] == {role: asdict(rule) for role, rule in TopicMap().rules.items()}


def test_partial_file(tmp_path):
    (tmp_path / "t.yaml").write_text(
        "namespace: /x\ntopics: {imu: /imu/raw, tail: null, camera: {frame: map}}"
    )
    topics = load_topic_map(tmp_path / "t.yaml")
    assert topics.namespace == "/x"
    assert topics.rules["imu"].topic == "/imu/raw"
    assert topics.rules["imu"].frame == "imu_link"
    assert "tail" not in topics.rules
    assert topics.rules["camera"].frame == "map"
    assert topics.rules["camera"].required


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("topics: {sonar: /x}", "role sonar: unknown; known: commands"),
        ("topics: {sonar: {frame: x}}", "role sonar: unknown; known: commands"),
        ("topics: {imu: {topc: /x}}", "expected a mapping with keys topic"),
        ("topics: {imu: 3}", "got 3; expected a mapping with keys topic"),
        ("topics: {imu: {topic: [a]}}", "got topic .'a'.; expected text"),
        ("topics: {imu: {required: often}}", "expected true or false"),
        ("topics: {imu: {time: noon}}", "'noon'; expected stamp or arrival"),
        ("topics: [imu]", "got topics .'imu'.; expected a mapping"),
        ("{speed: 3, 1: 2}", "expected a mapping with keys namespace"),
        ("- 1", "expected a mapping with keys namespace"),
        ("a: [", "cannot be read as YAML"),
        ("max_latency_s: 2020-13-45", "cannot be read as YAML"),
        ("max_latency_s: 0", "expected > 0"),
        ("max_latency_s: long", "got max_latency_s 'long'; expected a number"),
        ("namespace: 7", "got namespace 7; expected text"),
    ],
)
def test_mistakes(tmp_path, text, message):
    (tmp_path / "t.yaml").write_text(text)
    with pytest.raises(RecordingError, match=message):
        load_topic_map(tmp_path / "t.yaml")
