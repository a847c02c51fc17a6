# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The writer: valid MCAP for every reader, whole after a kill, closed on a full disk."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest
from mcap.reader import make_reader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader

from fish_bag import RecordingError, read_trial
from fish_bag import sample_recordings as samples
from fish_bag.bag_metadata import Qos
from fish_bag.mcap_writer import RESERVE_NAME, DiskFullError, McapRecording
from fish_bag.recover import recover

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
    from test_mcap_writer import IMU, PAYLOAD
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
    from test_mcap_writer import IMU, PAYLOAD
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
