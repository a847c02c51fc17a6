# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recovery of damaged recordings: no exception, no invented message, none lost that is whole before the damage."""

import struct
from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fish_bag import read_trial
from fish_bag import sample_recordings as samples
from fish_bag.bag import read_bag, salvage_bag
from fish_bag.bag_metadata import parse_metadata
from fish_bag.damage import KINDS, PROTECTED, check, damaged, make_sample, messages_of
from fish_bag.mcap_writer import McapRecording
from fish_bag.message_types import MessageType
from fish_bag.sample_recordings import SQLITE, WRITERS, write_rosbag2
from fish_bag.sqlite_pages import LEAF
from fish_bag.storage import ends_like_others

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
        broken, at = damaged(wholes[name].data, kind, rng)
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
