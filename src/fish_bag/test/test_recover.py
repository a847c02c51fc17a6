# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings that were cut or damaged: what is written, and what is recovered."""

import os
import signal
import struct
import subprocess
import sys
import textwrap
from collections import Counter
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.records import Message as MessageRecord
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from fish_bag import RecordingError, read_trial
from fish_bag import sample_recordings as samples
from fish_bag.bag import read_bag, salvage_bag
from fish_bag.bag_metadata import Qos, parse_metadata
from fish_bag.damage import KINDS, PROTECTED, check, make_sample, messages_of
from fish_bag.damage import damaged as damaged_bytes
from fish_bag.mcap_writer import RESERVE_NAME, DiskFullError, McapRecording
from fish_bag.message_types import MessageType
from fish_bag.recover import recover
from fish_bag.sample_recordings import SQLITE, WRITERS, write_rosbag2
from fish_bag.sqlite_pages import LEAF
from fish_bag.storage import ends_like_others


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


def test_a_recording_is_not_mended_into_itself(tmp_path):
    folder = samples.robot_recording(tmp_path / "a")
    with pytest.raises(RecordingError, match="expected a folder outside it"):
        recover(folder, folder / "mended")


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


SOME = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@pytest.fixture(scope="module")
def wholes(tmp_path_factory):
    """A small recording in every format."""
    folder, messages = tmp_path_factory.mktemp("whole"), samples.robot_messages(0.15)
    return {
        name: make_sample(name, write(folder / name.replace(" ", "_"), messages))
        for name, write in WRITERS.items()
    }


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("kind", KINDS)
def test_random_damage(wholes, tmp_path, name, kind):
    rng = np.random.default_rng([len(name), KINDS.index(kind)])
    for i in range(4):
        broken, at = damaged_bytes(wholes[name].data, kind, rng)
        folder = tmp_path / str(i)
        folder.mkdir()
        assert check(wholes[name], kind, broken, at, folder) == "", f"damage at byte {at}"


@SOME
@given(place=st.floats(0, 1), zeros=st.sampled_from([0, 1, 100, 5000]))
@pytest.mark.parametrize("name", ["own", "sqlite3", "ros1"])
def test_every_place_of_a_cut(wholes, tmp_path, name, place, zeros):
    sample = wholes[name]
    at = max(1, round(place * len(sample.data)))
    broken = sample.data[:at] + bytes(zeros)
    assert check(sample, "zero tail" if zeros else "cut", broken, at, tmp_path) == ""


@SOME
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
@pytest.mark.parametrize("name", PROTECTED)
def test_a_changed_bit(wholes, tmp_path, name, place, bit):
    sample = wholes[name]
    at = int(place * len(sample.data))
    broken = bytearray(sample.data)
    broken[at] ^= 1 << bit
    assert check(sample, "flip", bytes(broken), at, tmp_path) == ""


SCHEMAS = st.one_of(
    st.binary(max_size=200),
    st.text(max_size=200).map(lambda text: text.encode("utf-8", "replace")),
    st.sampled_from([b"int32 a\n---\nint32 b\n", b"lab/Other x\n", b"\n=====\nMSG: a/b\n"]),
)


@SOME
@given(
    definition=SCHEMAS,
    encoding=st.sampled_from(["", "ros2msg", "ros2idl", "protobuf", "jsonschema", "ros1msg"]),
    serialization=st.sampled_from(["cdr", "protobuf", "json", "ros1", ""]),
    raw=st.binary(max_size=100),
    time_ns=st.integers(0, 2**64 - 1),
    name=st.sampled_from(["lab_msgs/msg/Note", "lab.Note", "", "a/b/c/d", "sensor_msgs/msg/Imu"]),
)
def test_a_foreign_topic_never_harms_the_others(
    tmp_path_factory, definition, encoding, serialization, raw, time_ns, name
):
    folder = tmp_path_factory.mktemp("foreign") / "a"
    kind = MessageType(name, definition, "", encoding, serialization)
    with McapRecording(folder) as recording:
        recording.write(recording.add_topic("/foreign", kind), time_ns, raw)
        for arrival_ns, topic, message in samples.robot_messages(0.1):
            if topic.endswith(("joint_command", "camera/pose")):
                whole = bytes(samples.typestore().serialize_cdr(message, message.__msgtype__))
                entry = recording.add_topic(topic, message.__msgtype__)
                recording.write(entry, arrival_ns, whole)
    trial = read_trial(folder)
    assert (len(trial.commands), len(trial.camera)) == (10, 3)
    assert trial.duration < 1.0
    assert {topic.topic: topic.count for topic in trial.topics}["/foreign"] == 1


@SOME
@given(
    text=st.one_of(st.text(max_size=300), st.binary(max_size=300).map(lambda b: b.decode("latin1")))
)
def test_any_metadata_is_survived(text):
    for said in (text, "rosbag2_bagfile_information:\n  relative_file_paths: " + text):
        stated = parse_metadata(said)
        assert all(isinstance(file, str) for file in stated.files)
        assert stated.notes  # no such text is complete
        assert all("metadata.yaml" in note for note in stated.notes)


@SOME
@given(
    change=st.sampled_from(["", "a: [", "[]", "null", "\0" * 50, "rosbag2_bagfile_information: 3"])
)
def test_a_recording_is_read_whatever_its_metadata_says(tmp_path_factory, change):
    folder = tmp_path_factory.mktemp("metadata") / "a"
    path = samples.robot_recording(folder, duration=0.1)
    (path / "metadata.yaml").write_text(change)
    bag = read_bag(path, lambda *_: True)
    assert bag.count == len(samples.robot_messages(0.1))
    assert len(bag.notes) == 1
    assert "metadata.yaml" in bag.notes[0]


def test_parts_are_read_in_order_and_the_last_one_may_be_unnamed(tmp_path):
    """Part 10 comes after part 9; a recorder that was killed has not named its last part in metadata.yaml."""
    whole, folder = samples.robot_messages(1.2), tmp_path / "run"
    folder.mkdir()
    for k in range(12):
        part = whole[k * len(whole) // 12 : (k + 1) * len(whole) // 12]
        made = samples.write_mcap(tmp_path / f"run_{k}", part)
        (made / f"run_{k}.mcap").rename(folder / f"run_{k}.mcap")
    bag = read_bag(folder, lambda *_: True)
    assert bag.count == len(whole)
    text = "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.mcap]\n"
    (folder / "metadata.yaml").write_text(text)
    assert read_bag(folder, lambda *_: True).count == len(whole)


def test_counts_that_differ_are_said(tmp_path):
    path = samples.robot_recording(tmp_path / "a", duration=0.1)
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("message_count: 10", "message_count: 12"))
    notes = read_bag(path, lambda *_: True).notes
    assert "/fish/imu/data: 10 messages were read, metadata.yaml says 12" in notes


@pytest.mark.parametrize(
    "qos", ["", "[]", "- 3\n", "- {history: 9, depth: -1}\n", "- history: [", "!!python/x"]
)
def test_quality_of_service_of_any_shape(tmp_path, qos):
    """Offered profiles in the storage file and in metadata.yaml need not agree, nor make sense."""
    path = samples.robot_recording(tmp_path / "a", duration=0.1)
    metadata = path / "metadata.yaml"
    text = metadata.read_text()
    first = text.index("offered_qos_profiles:")
    last = text.index("type_description_hash", first)
    metadata.write_text(f"{text[:first]}offered_qos_profiles: {qos!r}\n      {text[last:]}")
    assert read_bag(path, lambda *_: True).count == len(samples.robot_messages(0.1))


def test_a_message_that_ends_in_more_zeros_than_others_is_not_trusted():
    others = [b"\1\2\3\0\0"] * 8 + [b"\1\2\0\0\0"]
    assert ends_like_others(b"\7\7\7\0\0", others)
    assert not ends_like_others(b"\7\7\0\0\0", others)
    assert not ends_like_others(b"\0\0", others)
    assert not ends_like_others(b"\7\7\0", others[:3])
    assert ends_like_others(b"\7\7\7", [])


def test_messages_in_the_write_ahead_log_are_read(wholes):
    sample = wholes["sqlite3 log"]
    bag = salvage_bag(sample.path)
    assert Counter(messages_of(bag)) == wholes["sqlite3"].messages
    assert "db3-wal" in bag.notes[0]


def test_a_cut_database_beside_a_whole_log(tmp_path):
    """sqlite3 takes zeros for pages that neither file holds, and calls the database whole."""
    write = WRITERS["sqlite3 log"]
    sample = make_sample("sqlite3 log", write(tmp_path / "whole", samples.robot_messages(0.4)))
    places = {
        end - back for end in range(8192, len(sample.data), 4096) for back in (278, 326, 360, 2000)
    }
    for at in sorted(places):
        for zeros in (0, 150):
            folder = tmp_path / f"{at}_{zeros}"
            folder.mkdir()
            kind, broken = "zero tail" if zeros else "cut", sample.data[:at] + bytes(zeros)
            assert check(sample, kind, broken, at, folder) == "", f"{kind} at byte {at}"


def test_a_row_with_the_number_of_another_hides_none(wholes, tmp_path):
    """Damage to the number of a row takes this row at most."""
    sample, page_bytes = wholes["sqlite3"], 4096
    found = [
        page
        for page in range(page_bytes, len(sample.data), page_bytes)
        if sample.data[page] == LEAF and int.from_bytes(sample.data[page + 3 : page + 5], "big") > 3
    ]
    page = found[-1]
    upper, lower = struct.unpack_from(">HH", sample.data, page + 8)
    broken = bytearray(sample.data)
    # a row begins with its length (two bytes from 128 on, one below) and its number; rows lie in falling order
    places = [page + cell + (2 if sample.data[page + cell] > 127 else 1) for cell in (upper, lower)]
    broken[places[0]] = sample.data[places[1]]
    assert check(sample, "byte", bytes(broken), places[0], tmp_path) == ""


@pytest.mark.parametrize("size", [5_000, 70_000], ids=["one overflow page", "many"])
def test_large_messages_come_back_from_the_pages_of_a_database(tmp_path, size):
    """Rows that do not fit into a page go on in others."""
    messages = [
        (1000 + i, "/fish/tail", samples.build.labelled_numbers("x", np.arange(size // 8) + i))
        for i in range(20)
    ]
    path = write_rosbag2(tmp_path / "a", messages, SQLITE)
    file = path / "a.db3"
    data = bytearray(file.read_bytes())
    struct.pack_into(">I", data, 28, 7 * len(data))  # the head states more pages than there are
    original = read_bag(path, lambda *_: True)
    file.write_bytes(bytes(data[:-4096]))
    saved = Counter(messages_of(salvage_bag(path)))
    whole = Counter(messages_of(original))
    assert not saved - whole
    assert saved.total() >= 18


IMU = "sensor_msgs/msg/Imu"
PAYLOAD = bytes(
    samples.typestore().serialize_cdr(
        samples.build.imu(1, (0, 0, 0), (0, 0, 9.81), (0, 0, 0, 1)), IMU
    )
)


def test_mcap_library_finds_index_and_checksums_right(tmp_path):
    path = samples.robot_recording(tmp_path / "a", duration=3.0)
    with (path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary.statistics.message_count == len(samples.robot_messages(3.0))
        assert (
            max(c.uncompressed_size for c in summary.chunk_indexes) < 34_000
        )  # 32 KiB and a message
        assert [index.name for index in summary.metadata_indexes] == ["fish_bag", "rosbag2"]
        by_topic = {channel.topic: channel.metadata for channel in summary.channels.values()}
        assert by_topic["/fish/imu/data"]["topic_type_hash"].startswith("RIHS01_")
        imu = [m.log_time for _, _, m in reader.iter_messages(topics=["/fish/imu/data"])]
        assert imu == [samples.ns(0.01 * i + 0.002) for i in range(300)]
        window = list(
            reader.iter_messages(starting_at=samples.ns(1.0), ending_before=samples.ns(1.5))
        )
        assert all(samples.ns(1.0) <= m.log_time < samples.ns(1.5) for _, _, m in window)
        assert len(window) > 200


def test_rosbag2_metadata(tmp_path):
    with McapRecording(tmp_path / "a", {"robot": "x"}) as recording:
        latched = recording.add_topic("/path", IMU, Qos(transient_local=True, depth=1))
        lossy = recording.add_topic("/lossy", IMU, Qos(reliable=False))
        recording.write(latched, 5_000, PAYLOAD)
        recording.write(lossy, 7_000, PAYLOAD)
    with Reader(tmp_path / "a") as reader:
        assert (reader.message_count, reader.start_time, reader.end_time) == (2, 5_000, 7_001)
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
        assert reader.storage.metadata.custom == {"robot": "x"}
    assert qos["/path"].durability == QosDurability.TRANSIENT_LOCAL
    assert qos["/path"].depth == 1
    assert qos["/lossy"].reliability == QosReliability.BEST_EFFORT
    assert not (tmp_path / "a" / RESERVE_NAME).exists()


def test_the_file_holds_a_copy_of_metadata_yaml(tmp_path):
    path = samples.robot_recording(tmp_path / "a", duration=0.5)
    with (path / "a.mcap").open("rb") as file:
        copies = [m for m in make_reader(file).iter_metadata() if m.name == "rosbag2"]
    assert [m.metadata for m in copies] == [
        {"serialized_metadata": (path / "metadata.yaml").read_text()}
    ]


def test_never_overwrites(tmp_path):
    samples.robot_recording(tmp_path / "a", duration=0.1)
    with pytest.raises(RecordingError, match="never overwritten"):
        McapRecording(tmp_path / "a")


def test_unknown_type_is_refused(tmp_path):
    with (
        McapRecording(tmp_path / "a") as recording,
        pytest.raises(RecordingError, match="my_msgs/msg/Own"),
    ):
        recording.add_topic("/x", "my_msgs/msg/Own")


WRITE_AND_STALL = """
    import sys, time
    from pathlib import Path
    from test_recover import IMU, PAYLOAD
    from fish_bag.mcap_writer import McapRecording
    recording = McapRecording(Path(sys.argv[1]), {"robot": "x"})
    topic = recording.add_topic("/fish/imu/data", IMU)
    for i in range(1000):
        recording.write(topic, 1_000_000_000_000 + i * 10_000_000, PAYLOAD)
    print("written", flush=True)
    time.sleep(60)
"""


def test_kill_loses_less_than_a_second(tmp_path):
    code = textwrap.dedent(WRITE_AND_STALL)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])
    }
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "a")], stdout=subprocess.PIPE, env=environment
    )
    assert process.stdout.readline() == b"written\n"
    process.send_signal(signal.SIGKILL)
    process.wait()
    with pytest.raises(RecordingError, match="robofish recover"):
        read_trial(tmp_path / "a")
    result = recover(tmp_path / "a", tmp_path / "b")
    last_ns = 1_000_000_000_000 + 999 * 10_000_000
    assert 0 <= last_ns - result.last_ns <= 0.5e9
    assert result.count >= 950
    assert read_trial(tmp_path / "b").metadata == {"robot": "x"}


FILL = """
    import signal, sys, resource
    from pathlib import Path
    from test_recover import IMU, PAYLOAD
    from fish_bag.mcap_writer import McapRecording
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
    recording = McapRecording(Path(sys.argv[1]))
    topic = recording.add_topic("/fish/imu/data", IMU)
    for i in range(5000):
        recording.write(topic, 1_000_000_000_000 + i * 10_000_000, PAYLOAD)
"""


def test_full_disk_closes_a_valid_recording(tmp_path):
    """A limit on the file's size stands in for the disk: the kernel refuses to write more."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])
    }
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(FILL), str(tmp_path / "a")],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert run.returncode == 1
    assert "DiskFullError" in run.stderr
    assert "writing failed" in run.stderr
    trial = read_trial(tmp_path / "a")
    assert 500 < len(trial.imu) < 900
    assert len(trial.imu) % 51 == 0  # whole chunks of 0.5 s
    assert trial.topics[0].count == len(trial.imu)


class FullAfter:
    """A file that takes so many bytes and no more."""

    def __init__(self, file, room):
        self.file, self.room = file, room

    def write(self, data):
        if len(data) > self.room:
            self.file.write(bytes(data[: self.room]))
            self.room = 0
            raise OSError(28, "No space left on device")
        self.room -= len(data)
        return self.file.write(data)

    def truncate(self, size):
        self.room += max(0, os.fstat(self.file.fileno()).st_size - size)
        self.file.truncate(size)

    def __getattr__(self, name):
        return getattr(self.file, name)


@pytest.mark.parametrize("room", [0, 30, 200, 5_000, 20_000, 40_000, 60_000])
def test_any_amount_of_room_leaves_a_recording_that_can_be_saved(tmp_path, room):
    recording = McapRecording(tmp_path / "a")
    topic = recording.add_topic("/fish/imu/data", IMU)
    recording.write(topic, 1, PAYLOAD)
    recording.flush()
    recording._file._raw = FullAfter(recording._file._raw, room)
    with pytest.raises(DiskFullError, match="No space left"):
        for i in range(1000):
            recording.write(topic, 2 + i * 10_000_000, PAYLOAD)
    recording.close()
    saved = recover(tmp_path / "a", tmp_path / "b").count
    assert saved == 1 + 51 * ((saved - 1) // 51)
    if room >= 5_000:
        assert len(read_trial(tmp_path / "a").imu) == saved


def test_a_disk_that_keeps_half_a_record_closes_the_recording_too(tmp_path):
    class Broken(FullAfter):
        def truncate(self, size):
            raise OSError(5, "Input/output error")

    recording = McapRecording(tmp_path / "a")
    topic = recording.add_topic("/fish/imu/data", IMU)
    recording.write(topic, 1, PAYLOAD)
    recording.flush()
    recording._file._raw = Broken(recording._file._raw, 200)
    with pytest.raises(DiskFullError, match="No space left"):
        for i in range(1000):
            recording.write(topic, 2 + i * 10_000_000, PAYLOAD)
    assert recording.closed
    assert recover(tmp_path / "a", tmp_path / "b").count == 1


@pytest.mark.parametrize("quiet", [True, False])
def test_a_clock_that_is_set_back_leaves_no_chunk_open(tmp_path, quiet):
    with McapRecording(tmp_path / "a", chunk_s=0.5) as recording:
        topic = recording.add_topic("/fish/imu/data", IMU)
        recording.write(topic, 3_600_000_000_000, PAYLOAD)
        before = recording.size
        if quiet:
            recording.flush_old(1_000_000_000)
        else:
            recording.write(topic, 1_000_000_000, PAYLOAD)
        assert recording.size > before
